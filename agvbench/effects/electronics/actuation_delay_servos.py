"""Delays of the servos and of the drive."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import DRIVE_WAIT, REAR_WAIT
from agvbench.effects.variants import Variant
from agvbench.types import Floats


@dataclass(frozen=True)
class ActuationDelayServos(Variant):
    """At t both servos carry out the command given at t − steering_s, and the drive the one given at t − drive_s."""

    name: ClassVar[str] = "actuation_delay_servos"
    variant_of: ClassVar[str] = "actuation_delay"
    stage: ClassVar[Stage] = Stage.TRANSPORT
    relaxes: ClassVar[str] = "no variable delay in the controller (9.2)"
    reference: ClassVar[str] = (
        "Bentvelsen 2015, section 9.2; servos of one make have the same delay, a motor controller its own"
    )
    limits: ClassVar[str] = (
        "what all delays have in common cannot be distinguished from mocap_latency where runs begin at rest"
    )
    equivalents: ClassVar[Mapping[str, Mapping[str, float]]] = {
        "actuation_delay.delay_s": {"steering_s": 0.5, "drive_s": 0.5}
    }

    steering_s: float = parameter(unit="s", low=0.0, high=2.0, scale=0.05)
    drive_s: float = parameter(unit="s", low=0.0, high=2.0, scale=0.05)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with a slightly smaller delay of the drive than of the servos, and with a slightly larger one."""
        delay = fitted["delay_s"]
        return [(1.1 * delay, 0.9 * delay), (0.9 * delay, 1.1 * delay)]

    @staticmethod
    def arrive(state: Floats, time_s: float, steering_s: float, drive_s: float) -> float:
        """Return the arrival of the servos' command, and set the relative delay of the drive's."""
        state[REAR_WAIT] = 0.0
        state[DRIVE_WAIT] = drive_s - steering_s
        return time_s + steering_s
