"""Delay of commands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.types import Floats


@dataclass(frozen=True)
class ActuationDelay(Effect):
    """The command used at time t is the one given at t − delay; before the first one arrives the vehicle is at rest.

    Radio, buffering and the frame of servo pulses add up to one constant delay.
    """

    name: ClassVar[str] = "actuation_delay"
    stage: ClassVar[Stage] = Stage.TRANSPORT
    relaxes: ClassVar[str] = "no variable delay in the controller (9.2)"
    reference: ClassVar[str] = "Bentvelsen 2015, section 9.2"
    limits: ClassVar[str] = "where runs start and end at rest it cannot be distinguished from mocap_latency"
    remedy: ClassVar[str] = (
        "measure the time from command to motion of servos and drive; shorten it in the firmware, or send "
        "commands earlier by it"
    )

    delay_s: float = parameter(unit="s", low=0.0, high=2.0, scale=0.05)

    @staticmethod
    def arrive(state: Floats, time_s: float, delay_s: float) -> float:
        """Return the time later by the delay."""
        return time_s + delay_s
