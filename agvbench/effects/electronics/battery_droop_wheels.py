"""Decrease of both wheels' speeds of a differential vehicle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import FRONT, FRONT_SPEED, HOURS, REAR_SPEED
from agvbench.effects.variants import Variant
from agvbench.types import Floats


@dataclass(frozen=True)
class BatteryDroopWheels(Variant):
    """Speed and yaw rate fall alike: ``v ← v (1 − per_hour · hours)`` and ``ω ← ω (1 − per_hour · hours)``.

    Both wheels have the same battery. The library's equation is that of a controller which holds the yaw rate.
    """

    name: ClassVar[str] = "battery_droop_wheels"
    variant_of: ClassVar[str] = "battery_droop"
    stage: ClassVar[Stage] = Stage.WHEELS
    relaxes: ClassVar[str] = "the battery is negligible (9.2)"
    reference: ClassVar[str] = "kinematics of two driven wheels (Siegwart and Nourbakhsh 2011, section 3.2)"
    limits: ClassVar[str] = "linear in time, as battery_droop; both motors lose the same share"
    needs_differential: ClassVar[bool] = True

    per_hour: float = parameter(unit="1/h", low=0.0, high=2.0, scale=0.1)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with the library's loss."""
        return [(fitted["per_hour"],)]

    @staticmethod
    def steer(state: Floats, per_hour: float) -> None:
        """Scale the yaw rate by time."""
        state[FRONT] *= 1.0 - per_hour * state[HOURS]

    @staticmethod
    def drive(state: Floats, per_hour: float) -> None:
        """Scale the speed by time."""
        factor = 1.0 - per_hour * state[HOURS]
        state[FRONT_SPEED] *= factor
        state[REAR_SPEED] *= factor
