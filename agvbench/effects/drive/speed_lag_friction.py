"""First-order lags under power, and coasting against dry friction without."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import ACCELERATE_LAG, BRAKE_LAG, BRAKING_LIMIT, SPEED_AIM
from agvbench.effects.variants import Variant
from agvbench.types import Floats

_TYPICAL_MPS = 0.3
_SHORTEST_S = 0.01


@dataclass(frozen=True)
class SpeedLagFriction(Variant):
    """A powered motor follows its command as ``v̇ = (v_map − v) / lag``; without power dry friction stops the vehicle.

    At neutral ``v̇ = −v / brake lag`` as well, but ``|v̇|`` is at most the deceleration by friction: the distance to rest
    grows with the square of the speed.
    """

    name: ClassVar[str] = "speed_lag_friction"
    variant_of: ClassVar[str] = "speed_lag"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "acceleration and deceleration are negligible (3.2, assumption 5)"
    reference: ClassVar[str] = (
        "Coulomb friction (Armstrong-Hélouvry, Dupont and Canudas de Wit 1994, A survey of models, analysis tools and "
        "compensation methods for the control of machines with friction, Automatica 30)"
    )
    limits: ClassVar[str] = (
        "at one speed alone it predicts the same as speed_lag; without lags and where every command to less speed is "
        "neutral, the same as speed_lag_ramp"
    )

    accelerate_s: float = parameter(unit="s", low=0.0, high=10.0, scale=0.1)
    brake_s: float = parameter(unit="s", low=0.0, high=10.0, scale=0.1)
    coast_mps2: float = parameter(unit="m/s²", low=0.02, high=100.0, scale=1.0, null=math.inf)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with the coasting distance of the library's lag, at a typical speed and at twice that."""
        accelerates, brakes = (max(fitted[name], _SHORTEST_S) for name in ("accelerate_s", "brake_s"))
        return [(accelerates, _SHORTEST_S, speed / (2.0 * brakes)) for speed in (_TYPICAL_MPS, 2.0 * _TYPICAL_MPS)]

    @staticmethod
    def aim(state: Floats, accelerate_s: float, brake_s: float, coast_mps2: float) -> None:
        """Set the lags of the drive, and the limit of the unpowered one."""
        state[ACCELERATE_LAG] = max(state[ACCELERATE_LAG], accelerate_s)
        state[BRAKE_LAG] = max(state[BRAKE_LAG], brake_s)
        if state[SPEED_AIM] == 0.0:
            state[BRAKING_LIMIT] = min(state[BRAKING_LIMIT], coast_mps2)
