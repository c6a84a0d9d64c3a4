"""Pulses: as wide as commanded, of one command in every frame, and neutral when nobody speaks."""

from __future__ import annotations

import itertools
import random

import pytest
from pulse_frames import CYCLES_PER_US, FRAME_CYCLES, NEUTRAL, TOLERANCE_US, is_near, widths_by_frame

from agvbench.adapters.simavr.microcontroller import Microcontroller
from agvbench.types import Command

COMMANDS = 1000


def drive(microcontroller: Microcontroller, commands: list[Command], seed: int = 3) -> list[tuple[float, ...]]:
    """Give one command after the other, at all phases of the frame; return the widths [µs] in every frame."""
    luck, pulses = random.Random(seed), []
    for command in commands:
        microcontroller.set_command(command)
        pulses += microcontroller.run_until(microcontroller.now_s + luck.uniform(0.02, 0.06))
    pulses += microcontroller.run_until(microcontroller.now_s + 0.06)
    return widths_by_frame(pulses)


def distinct_commands(count: int) -> list[Command]:
    """Commands that differ from the one before in every channel, in whole degrees (80 µs are 6°)."""
    return [Command(*(1180.0 + 80.0 * ((index + shift) % 8) for shift in (0, 3, 6))) for index in range(count)]


def test_every_width_between_the_limits_is_kept_within_a_microsecond(version_2: Microcontroller) -> None:
    luck = random.Random(1)
    wanted = [Command(*(float(luck.randint(600, 2400)) for _ in range(3))) for _ in range(200)]
    wanted += [Command(600.0, 2400.0, 600.0), Command(2400.0, 2400.0, 2400.0), Command(600.0, 600.0, 600.0)]
    worst_us = 0.0
    for command in wanted:
        version_2.set_command(command)
        version_2.run_until(version_2.now_s + 0.03)
        widths = widths_by_frame(version_2.run_until(version_2.now_s + 0.05))[0]
        worst_us = max(worst_us, *(abs(a - b) for a, b in zip(widths, command, strict=True)))
    assert worst_us <= TOLERANCE_US


def test_whole_degrees_are_kept_within_a_microsecond(version_1: Microcontroller) -> None:
    for degrees in range(30, 151, 7):
        pulse_us = 1500.0 + (degrees - 90) * 40.0 / 3.0
        version_1.set_command(Command(pulse_us, 3000.0 - pulse_us, pulse_us))
        version_1.run_until(version_1.now_s + 0.03)
        widths = widths_by_frame(version_1.run_until(version_1.now_s + 0.05))[0]
        assert is_near(widths, (pulse_us, 3000.0 - pulse_us, pulse_us))


def test_version_1_rounds_to_degrees(version_1: Microcontroller) -> None:
    version_1.set_command(Command(1506.0, 1507.0, 1494.0))
    version_1.run_until(version_1.now_s + 0.03)
    widths = widths_by_frame(version_1.run_until(version_1.now_s + 0.05))[0]
    assert is_near(widths, (1500.0, 1513.333, 1500.0))


def test_frames_begin_every_20_ms_whatever_is_on_the_line(microcontroller: Microcontroller) -> None:
    pulses = microcontroller.run_until(microcontroller.now_s + 0.1)
    for command in distinct_commands(50):
        microcontroller.set_command(command)
        pulses += microcontroller.run_until(microcontroller.now_s + 0.013)
    rises = [pulse.rise for pulse in pulses if pulse.channel == 0]
    assert len(rises) > 30
    assert all(abs(b - a - FRAME_CYCLES) <= CYCLES_PER_US for a, b in itertools.pairwise(rises))


def test_version_2_never_mixes_two_commands_in_a_frame(version_2: Microcontroller) -> None:
    commands = distinct_commands(COMMANDS)
    frames = drive(version_2, commands)
    known = {NEUTRAL, *map(tuple, commands)}
    assert len(frames) > COMMANDS
    assert all(any(is_near(widths, command) for command in known) for widths in frames)
    # Not because commands were ignored: each was driven.
    driven = [next(command for command in known if is_near(widths, command)) for widths in frames]
    order = [command for index, command in enumerate(driven) if index == 0 or command != driven[index - 1]]
    assert order[-COMMANDS:] == [tuple(command) for command in commands]


def test_version_1_mixes_two_commands_where_they_fall_into_a_frame(version_1: Microcontroller) -> None:
    commands = distinct_commands(COMMANDS)
    frames = drive(version_1, commands)
    known = {NEUTRAL, *map(tuple, commands)}
    mixed = sum(not any(is_near(widths, command) for command in known) for widths in frames)
    # A command falls between the first pulse's beginning and the last's with the chance of two pulses in 20 ms, 0.15.
    assert 0.10 * COMMANDS < mixed < 0.20 * COMMANDS


def test_the_same_commands_give_the_same_pulses_to_the_cycle(version_2: Microcontroller) -> None:
    def pulses() -> list[object]:
        version_2.reset()
        found: list[object] = []
        for command in distinct_commands(20):
            version_2.set_command(command)
            found += version_2.run_until(version_2.now_s + 0.0371)
        return found

    first = pulses()
    assert len(first) > 90
    assert pulses() == first
    other = Microcontroller("2")
    version_2.close()
    version_2.__dict__.update(other.__dict__)
    assert pulses() == first


def test_what_was_said_before_a_reset_is_not_heard_after_it(version_2: Microcontroller) -> None:
    for _ in range(5):
        version_2.set_command(Command(1800.0, 1300.0, 1700.0))
        version_2.reset()
        assert version_2.conversation.garbled == 0
        assert all(is_near(widths, NEUTRAL) for widths in widths_by_frame(version_2.run_until(0.2)))


@pytest.mark.parametrize("after_s", [0.0, 0.004, 0.009, 0.0131, 0.0199])
def test_the_watchdog_bites_after_250_ms_of_silence(version_2: Microcontroller, after_s: float) -> None:
    version_2.run_until(version_2.now_s + after_s)
    said_s = version_2.now_s
    version_2.set_command(Command(1800.0, 1300.0, 1700.0))
    pulses = version_2.run_until(said_s + 0.6)
    driven = [pulse for pulse in pulses if pulse.channel == 0 and pulse.width_us > 1700.0]
    neutral = next(pulse for pulse in pulses if pulse.channel == 0 and pulse.rise > driven[-1].rise)
    assert abs(neutral.rise / 16e6 - said_s - 0.250) <= 0.025
    assert is_near(widths_by_frame(pulses)[-1], NEUTRAL)
    assert version_2.conversation.watchdog_bites == 1
    # The next command drives again.
    version_2.set_command(Command(1800.0, 1300.0, 1700.0))
    assert is_near(widths_by_frame(version_2.run_until(version_2.now_s + 0.1))[-1], (1800.0, 1300.0, 1700.0))


def test_the_watchdog_sleeps_while_commands_come_and_when_the_vehicle_stands(version_2: Microcontroller) -> None:
    for _ in range(10):
        version_2.set_command(Command(1800.0, 1500.0, 1500.0))
        assert widths_by_frame(version_2.run_until(version_2.now_s + 0.2))[-1][0] > 1700.0
    version_2.set_command(Command(*NEUTRAL))
    version_2.run_until(version_2.now_s + 1.0)
    assert version_2.conversation.watchdog_bites == 0


def test_version_1_drives_on_for_ever(version_1: Microcontroller) -> None:
    version_1.set_command(Command(1800.0, 1500.0, 1500.0))
    assert widths_by_frame(version_1.run_until(version_1.now_s + 5.0))[-1][0] > 1700.0
