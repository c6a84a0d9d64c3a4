"""Exponential decrease of the speed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import FRONT_SPEED, HOURS, REAR_SPEED
from agvbench.effects.variants import Variant
from agvbench.types import Floats


@dataclass(frozen=True)
class BatteryDroopExponential(Variant):
    """Speed falls exponentially to a share of itself: ``v ← v (1 − share (1 − exp(−hours / time_constant)))``."""

    name: ClassVar[str] = "battery_droop_exponential"
    variant_of: ClassVar[str] = "battery_droop"
    stage: ClassVar[Stage] = Stage.WHEELS
    relaxes: ClassVar[str] = "the battery is negligible (9.2)"
    reference: ClassVar[str] = "Bentvelsen 2015, section 8.2 (the steep end of a full battery)"
    limits: ClassVar[str] = "in a session much shorter than the time constant it cannot be distinguished from a line"

    share: float = parameter(unit="–", low=0.0, high=0.9, scale=0.05)
    time_constant_h: float = parameter(unit="h", low=0.05, high=20.0, scale=0.5, null=0.5)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with the library's slope at the beginning of the session."""
        return [(fitted["per_hour"] * hours, hours) for hours in (0.3, 1.0)]

    @staticmethod
    def drive(state: Floats, share: float, time_constant_h: float) -> None:
        """Scale both axle speeds by time."""
        if share != 0.0:
            factor = 1.0 + share * math.expm1(-state[HOURS] / time_constant_h)
            state[FRONT_SPEED] *= factor
            state[REAR_SPEED] *= factor
