"""Whatever comes over the line that is not exactly a command: one answer that says why, and nothing moves."""

from __future__ import annotations

import re

import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st
from pulse_frames import NEUTRAL, ask, is_near, widths_by_frame

from agvbench.adapters.serial_line.lines import encode_line
from agvbench.adapters.simavr.microcontroller import Microcontroller
from agvbench.types import Command

COMMAND, SYNTAX, RANGE, LENGTH, BYTES, CHECKSUM = 1, 2, 3, 5, 6, 7
MAY_BE_RIGHT = re.compile(rb"V|S( [0-9]{1,5}){4}")
MAY_BE_RIGHT_2 = re.compile(r"[VQ]|S( [0-9]{1,5}){4}|M( [0-9]{1,5}){5}")
LINES = st.one_of(
    st.binary(max_size=60).map(lambda data: data.replace(b"\n", b" ")),
    st.from_regex(rb"[SMVQ]( [0-9]{0,6}){0,6}[ *]?", fullmatch=True),
)
TEXTS = st.one_of(
    st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=43),
    st.from_regex(r"[SMVQsq]?( {0,2}[0-9]{0,6}){0,6} ?", fullmatch=True).filter(lambda text: len(text) <= 43),
)
DRIVEN = (1700.0, 1300.0, 1540.0)
"""Whole degrees, so that either version holds it."""


def stands_still(microcontroller: Microcontroller, data: bytes) -> bytes:
    """Send bytes and return what came back; every pulse then and soon after is neutral."""
    said, pulses = ask(microcontroller, data, 0.02 + len(data) * 1e-4)
    more, after = ask(microcontroller, b"", 0.05)
    widths = widths_by_frame(pulses + after)
    assert widths
    assert all(is_near(one, NEUTRAL) for one in widths), (data, widths)
    return said + more


def codes(said: bytes) -> list[int]:
    found = [re.fullmatch(rb"err \d+ (\d)(\*[0-9A-F]{4})?", line) for line in said.split(b"\n") if line]
    assert all(found), said
    return [int(one[1]) for one in found if one]


@pytest.mark.parametrize(
    ("line", "code"),
    [
        (b"", COMMAND),
        (b" ", COMMAND),
        (b"X 1 2 3 4", COMMAND),
        (b"s 1 1700 1500 1500", COMMAND),
        (b"VV", COMMAND),
        (b"V 1", COMMAND),
        (b"S", SYNTAX),
        (b"S 1 1700 1500", SYNTAX),
        (b"S 1 1700 1500 1500 1", SYNTAX),
        (b"S 1 1700 1500 1500 ", SYNTAX),
        (b"S  1 1700 1500 1500", SYNTAX),
        (b"S 1 1700 1500 15x0", SYNTAX),
        (b"S 1 -700 1500 1500", SYNTAX),
        (b"S 1 1700.0 1500 1500", SYNTAX),
        (b"S 1 0x6a4 1500 1500", SYNTAX),
        (b"S 1 67236 1500 1500", SYNTAX),
        (b"S 65536 1700 1500 1500", SYNTAX),
        (b"S 1 001700 1500 1500", SYNTAX),
        (b"S1 1700 1500 1500", SYNTAX),
        (b"S 1 29 90 90", RANGE),
        (b"S 1 151 90 90", RANGE),
        (b"S 1 2401 1500 1500", RANGE),
        (b"S 1 1500 599 1500", RANGE),
        (b"S 1 1500 1500 0", RANGE),
        (b"S 1 1700 1500 1500" + 40 * b"0", LENGTH),
        (b"S\t1 1700 1500 1500", BYTES),
        (b"S 1 1700\x00 1500 1500", BYTES),
        (b"S 1 1700 1500 1500\r", BYTES),
        (b"S 1 1700 1500 15\xb00", BYTES),
        (b"\x1b[A", BYTES),
    ],
)
def test_each_mistake_has_its_code(microcontroller: Microcontroller, line: bytes, code: int) -> None:
    microcontroller.reset()
    plain = line + b"\n"
    checked = line + encode_line(line.decode("latin-1"), checksum=True)[-6:] if line.isascii() else plain
    first = microcontroller.hello.firmware_version == 1 or code in (LENGTH, BYTES)
    # Version 2 was greeted with a checksum: from then on every line needs one.
    assert codes(stands_still(microcontroller, plain if first else checked)) == [code]


@pytest.mark.parametrize(
    "line",
    [
        b"S 1 1700 1500 1500",
        b"S 1 1700 1500 1500*0000",
        b"S 1 1700 1500 1500*",
        b"S 1 1700 1500 1500*12345",
        b"S 1 1600 1500 1500" + encode_line("S 1 1700 1500 1500", checksum=True)[-6:-1],
        b"V*3a33",
    ],
)
def test_a_wrong_or_missing_checksum_moves_nothing(version_2: Microcontroller, line: bytes) -> None:
    assert codes(stands_still(version_2, line + b"\n")) == [CHECKSUM]


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("M 1 1700 1500 1500", SYNTAX),
        ("M 1 1700 1500 1500 100 1", SYNTAX),
        ("M 1 1700 1500 1500 19", RANGE),
        ("M 1 1700 1500 1500 10001", RANGE),
    ],
)
def test_segments_are_read_as_strictly(version_2: Microcontroller, line: str, code: int) -> None:
    assert codes(stands_still(version_2, encode_line(line, checksum=True))) == [code]


def test_version_1_knows_no_segments_no_status_no_checksums(version_1: Microcontroller) -> None:
    assert codes(stands_still(version_1, b"M 1 100 90 90 100\nQ\nV*3A33\n")) == [COMMAND] * 3
    assert codes(stands_still(version_1, encode_line("S 1 100 90 90", checksum=True))) == [SYNTAX]


def test_a_line_without_its_end_moves_nothing_and_spoils_only_the_next(version_2: Microcontroller) -> None:
    good = encode_line("S 7 1700 1300 1550", checksum=True)
    assert stands_still(version_2, good[:-1]) == b""
    assert codes(stands_still(version_2, good)) == [CHECKSUM]
    said, pulses = ask(version_2, good, 0.1)
    assert said.startswith(b"ok 7*")
    assert is_near(widths_by_frame(pulses)[-1], (1700.0, 1300.0, 1550.0))


def test_a_flood_of_noise_is_survived(microcontroller: Microcontroller) -> None:
    noise = bytes(range(256)) * 8
    said = stands_still(microcontroller, noise)
    assert set(codes(said)) <= {COMMAND, SYNTAX, LENGTH, BYTES, CHECKSUM}
    microcontroller.reset()
    ask(microcontroller, b"\n", 0.02)


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(LINES)
@example(b"S 1 1700 1500 1500 \x00")
def test_no_malformed_line_moves_anything(microcontroller: Microcontroller, line: bytes) -> None:
    version = str(microcontroller.hello.firmware_version)
    if version == "1" and MAY_BE_RIGHT.fullmatch(line):
        return
    assert len(codes(stands_still(microcontroller, line + b"\n"))) == 1


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 24), st.integers(1, 255))
def test_no_flipped_bits_in_a_good_line_are_believed(version_2: Microcontroller, at: int, flip: int) -> None:
    good = bytearray(encode_line("S 7 1700 1300 1550", checksum=True)[:-1])
    good[at % len(good)] ^= flip
    if b"\n" in good:
        return
    assert codes(stands_still(version_2, bytes(good) + b"\n"))[0] in (BYTES, CHECKSUM)


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(TEXTS)
@example("M 1 1700 1500 1500 100 ")
@example("S 1 1700 1500 1500*31C3")
def test_no_malformed_line_moves_anything_though_its_checksum_is_right(version_2: Microcontroller, text: str) -> None:
    assume(not MAY_BE_RIGHT_2.fullmatch(text))
    assert len(codes(stands_still(version_2, encode_line(text, checksum=True)))) == 1


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(LINES)
def test_no_malformed_line_disturbs_what_is_driven(microcontroller: Microcontroller, line: bytes) -> None:
    assume(not MAY_BE_RIGHT.fullmatch(line))
    microcontroller.set_command(Command(*DRIVEN))
    microcontroller.run_until(microcontroller.now_s + 0.05)
    said, pulses = ask(microcontroller, line + b"\n", 0.08)
    widths = widths_by_frame(pulses)
    assert widths
    assert all(is_near(one, DRIVEN) for one in widths), (line, widths)
    assert len(codes(said)) == 1
