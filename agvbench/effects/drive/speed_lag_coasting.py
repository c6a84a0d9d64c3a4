"""Limited acceleration under power, and exponential coasting without."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import BODY_ACCELERATION_LIMIT, BODY_BRAKING_LIMIT, BRAKE_LAG, SPEED_AIM
from agvbench.effects.variants import Variant
from agvbench.types import Floats

_TYPICAL_MPS = 0.3
_SHORTEST_S = 0.01


@dataclass(frozen=True)
class SpeedLagCoasting(Variant):
    """A powered motor accelerates and brakes with limited force; without power viscous friction stops the vehicle.

    The body's ``|v̇| ≤ acceleration`` under every command but neutral, and ``v̇ = −v / T`` at neutral. A command of less
    speed is therefore reached sooner than the vehicle would coast to it.
    """

    name: ClassVar[str] = "speed_lag_coasting"
    variant_of: ClassVar[str] = "speed_lag"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "acceleration and deceleration are negligible (3.2, assumption 5)"
    reference: ClassVar[str] = "Bentvelsen 2015, section 8.1: distances of acceleration and braking"
    limits: ClassVar[str] = "without a change of speed while driving it predicts the same as speed_lag_ramp_up"

    acceleration_mps2: float = parameter(unit="m/s²", low=0.02, high=100.0, scale=1.0, null=math.inf)
    coast_s: float = parameter(unit="s", low=0.0, high=10.0, scale=0.2)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with a ramp over the distance of the library's lag, at a typical speed and at twice that."""
        lag = max(fitted["accelerate_s"], _SHORTEST_S)
        return [(speed / (2.0 * lag), fitted["brake_s"]) for speed in (_TYPICAL_MPS, 2.0 * _TYPICAL_MPS)]

    @staticmethod
    def aim(state: Floats, acceleration_mps2: float, coast_s: float) -> None:
        """Set the limits of the powered drive, or the lag of the unpowered one."""
        if state[SPEED_AIM] == 0.0:
            state[BRAKE_LAG] = max(state[BRAKE_LAG], coast_s)
        else:
            state[BODY_ACCELERATION_LIMIT] = min(state[BODY_ACCELERATION_LIMIT], acceleration_mps2)
            state[BODY_BRAKING_LIMIT] = min(state[BODY_BRAKING_LIMIT], acceleration_mps2)
