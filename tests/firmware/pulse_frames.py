"""What tests of the firmware share: pulses as frames of three, and talking past the conversation."""

from __future__ import annotations

from agvbench.adapters.simavr.host import Pulse
from agvbench.adapters.simavr.microcontroller import Microcontroller

CYCLES_PER_US = 16
FRAME_CYCLES = 20_000 * CYCLES_PER_US
NEUTRAL = (1500.0, 1500.0, 1500.0)
TOLERANCE_US = 1.0


def widths_by_frame(pulses: list[Pulse]) -> list[tuple[float, ...]]:
    """Return the widths [µs] of drive, front and rear in each whole frame."""
    while pulses and pulses[0].channel != 0:
        pulses = pulses[1:]
    whole = len(pulses) // 3
    frames = [pulses[3 * index : 3 * index + 3] for index in range(whole)]
    assert all([pulse.channel for pulse in frame] == [0, 1, 2] for frame in frames)
    return [tuple((pulse.fall - pulse.rise) / CYCLES_PER_US for pulse in frame) for frame in frames]


def is_near(widths: tuple[float, ...], wanted: tuple[float, ...]) -> bool:
    return all(abs(a - b) <= TOLERANCE_US for a, b in zip(widths, wanted, strict=True))


def ask(microcontroller: Microcontroller, data: bytes, during_s: float = 0.02) -> tuple[bytes, list[Pulse]]:
    """Send bytes as they are; return the bytes that came back and the pulses that ended."""
    return microcontroller.exchange(data, microcontroller.now_s + during_s)
