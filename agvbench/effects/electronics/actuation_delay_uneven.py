"""Different delays of the command channels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import DRIVE_WAIT, REAR_WAIT
from agvbench.effects.variants import Variant
from agvbench.types import Floats


@dataclass(frozen=True)
class ActuationDelayUneven(Variant):
    """At t each channel (front servo, rear servo, drive) carries out the command given at t − its delay."""

    name: ClassVar[str] = "actuation_delay_uneven"
    variant_of: ClassVar[str] = "actuation_delay"
    stage: ClassVar[Stage] = Stage.TRANSPORT
    relaxes: ClassVar[str] = "no variable delay in the controller (9.2)"
    reference: ClassVar[str] = (
        "Bentvelsen 2015, section 9.2; servo pulses and motor controllers have frames of their own"
    )
    limits: ClassVar[str] = (
        "what all delays have in common cannot be distinguished from mocap_latency where runs begin at rest"
    )
    equivalents: ClassVar[Mapping[str, Mapping[str, float]]] = {
        "actuation_delay.delay_s": {"front_s": 1 / 3, "rear_s": 1 / 3, "drive_s": 1 / 3}
    }
    needs_steered_axles: ClassVar[bool] = True

    front_s: float = parameter(unit="s", low=0.0, high=2.0, scale=0.05)
    rear_s: float = parameter(unit="s", low=0.0, high=2.0, scale=0.05)
    drive_s: float = parameter(unit="s", low=0.0, high=2.0, scale=0.05)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with a slightly smaller delay of the drive than of the servos, and with a slightly larger one."""
        delay = fitted["delay_s"]
        return [(1.1 * delay, 1.1 * delay, 0.9 * delay), (0.9 * delay, 0.9 * delay, 1.1 * delay)]

    @staticmethod
    def arrive(state: Floats, time_s: float, front_s: float, rear_s: float, drive_s: float) -> float:
        """Return the arrival of the front servo's command, and set the relative delays of the others."""
        # At null it keeps the relative delays of the other variant.
        if front_s != 0.0 or rear_s != 0.0 or drive_s != 0.0:
            state[REAR_WAIT] = rear_s - front_s
            state[DRIVE_WAIT] = drive_s - front_s
        return time_s + front_s
