"""Drift down the slope by a power of the speed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import FORWARD, LEFT, X_RATE, Y_RATE
from agvbench.effects.variants import Variant
from agvbench.types import Floats

_TYPICAL_MPS = 0.3


@dataclass(frozen=True)
class FloorTiltPower(Variant):
    """The drift grows with the speed: ``drift (v / 0.3 m/s)ᵖ`` in one direction; as floor_tilt for p near 0."""

    name: ClassVar[str] = "floor_tilt_power"
    variant_of: ClassVar[str] = "floor_tilt"
    stage: ClassVar[Stage] = Stage.FLOOR
    relaxes: ClassVar[str] = "the floor is level (3.2)"
    reference: ClassVar[str] = "agvbench's own"
    limits: ClassVar[str] = "one slope for the whole floor; several speeds and directions are needed"

    drift_mps: float = parameter(unit="m/s", low=0.0, high=0.2, scale=0.005)
    direction_rad: float = parameter(unit="rad", low=-math.tau, high=math.tau, scale=0.5)
    exponent: float = parameter(unit="–", low=0.1, high=3.0, scale=0.5, null=0.1)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with exponents of 0.5 and 1."""
        return [(fitted["drift_mps"], fitted["direction_rad"], p) for p in (0.5, 1.0)]

    @staticmethod
    def drift(state: Floats, drift_mps: float, direction_rad: float, exponent: float) -> None:
        """Add the drift velocity."""
        if drift_mps != 0.0:
            square = state[FORWARD] * state[FORWARD] + state[LEFT] * state[LEFT]
            speed = drift_mps * (square / (_TYPICAL_MPS * _TYPICAL_MPS)) ** (0.5 * exponent)
            state[X_RATE] += speed * math.cos(direction_rad)
            state[Y_RATE] += speed * math.sin(direction_rad)
