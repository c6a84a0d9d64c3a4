"""Timed segments: the vehicle drives them by its own clock, as long as the host lives."""

from __future__ import annotations

from pulse_frames import NEUTRAL, ask, is_near, widths_by_frame

from agvbench.adapters.serial_line.lines import encode_line
from agvbench.adapters.simavr.host import Pulse
from agvbench.adapters.simavr.microcontroller import Microcontroller


def line(text: str) -> bytes:
    return encode_line(text, checksum=True)


def drive(microcontroller: Microcontroller, texts: list[str], duration_s: float) -> list[Pulse]:
    """Queue segments, then ask for the status ten times a second."""
    _, pulses = ask(microcontroller, b"".join(map(line, texts)), 0.1)
    for _ in range(round(duration_s / 0.1)):
        said, more = ask(microcontroller, line("Q"), 0.1)
        assert said.startswith(b"Q ")
        pulses += more
    return pulses


def test_segments_last_as_long_as_they_say_and_their_rounding_does_not_add_up(version_2: Microcontroller) -> None:
    lengths_ms = [95, 131, 247, 95, 333, 27, 150]
    texts = [f"M {index} {1600 + 10 * index} 1400 1550 {ms}" for index, ms in enumerate(lengths_ms, 1)]
    pulses = drive(version_2, texts, 1.5)
    drives = [(pulse.rise / 16e6, pulse.width_us) for pulse in pulses if pulse.channel == 0]
    began_s = next(rise_s for rise_s, width_us in drives if width_us > 1605.0)
    for index in range(1, len(lengths_ms) + 1):
        until_s = next(
            rise_s for rise_s, width_us in drives if rise_s > began_s and _differs(width_us, index, drives, rise_s)
        )
        assert abs(until_s - began_s - sum(lengths_ms[:index]) / 1000.0) <= 0.0101
    assert is_near(widths_by_frame(pulses)[-1], NEUTRAL)


def _differs(width_us: float, index: int, drives: list[tuple[float, float]], rise_s: float) -> bool:
    """Whether segment `index` is over at `rise_s`: it was driven before, and is not driven any more."""
    wanted_us = 1600.0 + 10.0 * index
    driven = any(abs(width - wanted_us) < 2.0 for at_s, width in drives if at_s < rise_s)
    return driven and abs(width_us - wanted_us) >= 2.0


def test_the_queue_holds_eight_and_says_when_it_is_full(version_2: Microcontroller) -> None:
    answers = b""
    for index in range(1, 11):
        answers += ask(version_2, line(f"M {index} 1600 1500 1500 10000"), 0.004)[0]
    answers += ask(version_2, b"", 0.02)[0]
    words = [answer.partition(b"*")[0] for answer in answers.split(b"\n") if answer]
    # The first may have begun to be driven while the others came.
    assert words[:8] == [b"ok %d" % index for index in range(1, 9)]
    assert words[-1] == b"err 10 4"


def test_a_command_ends_the_segments_and_silence_does_too(version_2: Microcontroller) -> None:
    drive(version_2, ["M 1 1700 1500 1500 5000", "M 2 1300 1500 1500 5000"], 0.2)
    _, pulses = ask(version_2, line("S 3 1600 1500 1500"), 0.1)
    assert is_near(widths_by_frame(pulses)[-1], (1600.0, 1500.0, 1500.0))
    drive(version_2, ["M 4 1700 1500 1500 5000"], 0.2)
    said, pulses = ask(version_2, b"", 0.5)
    assert line("W") in said
    assert is_near(widths_by_frame(pulses)[-1], NEUTRAL)
    assert ask(version_2, line("Q"))[0].startswith(b"Q 1500 1500 1500 0 3*")
