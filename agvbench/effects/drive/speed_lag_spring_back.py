"""A drive train with backlash and a motor of limited force; without power it winds up and springs back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import (
    ACCELERATE_LAG,
    BODY_ACCELERATION_LIMIT,
    BODY_BRAKING_LIMIT,
    BRAKE_LAG,
    COAST_RELAXATION,
    COAST_SPRING,
    DRIVE_BACKLASH,
    SPEED_AIM,
)
from agvbench.effects.variants import Variant
from agvbench.types import Floats

_TYPICAL_MPS = 0.3
_SHORTEST_S = 0.02
_SPRINGS_PER_S2 = (0.5, 2.5)
_RELAXATION_S = 0.5
_BACKLASH_M = 0.004


@dataclass(frozen=True)
class SpeedLagSpringBack(Variant):
    """A powered motor has limited force; without power friction and a spring in the drive train stop the vehicle.

    Under power ``v̇ = (v_map − v) / lag_s``, and the body's ``|v̇|`` is limited, for each direction of the command by a
    limit of its own. At every start the motor first turns through the backlash, at the speed of the commands. At
    neutral ``v̇ = −v / T − k w``, and the windup w obeys ``ẇ = v − w / R``: the vehicle stops sooner than friction stops
    it, and rolls back. Under power w relaxes and has no other consequence.
    """

    name: ClassVar[str] = "speed_lag_spring_back"
    variant_of: ClassVar[str] = "speed_lag"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "acceleration and deceleration are negligible (3.2, assumption 5)"
    reference: ClassVar[str] = (
        "Maxwell element beside viscous friction (Findley, Lai and Onaran 1976, chapter 5); gear backlash (Nordin and "
        "Gutman 2002, Controlling mechanical systems with backlash, Automatica 38)"
    )
    limits: ClassVar[str] = (
        "with much friction (T far below R) and without lag and backlash it predicts the same as speed_lag_coasting; "
        "at one speed alone a backlash cannot be distinguished from a delay of the drive; a controller that ramps the "
        "speed of the wheels starts later in turns"
    )

    forward_mps2: float = parameter(unit="m/s²", low=0.02, high=100.0, scale=1.0, null=math.inf)
    backward_mps2: float = parameter(unit="m/s²", low=0.02, high=100.0, scale=1.0, null=math.inf)
    coast_s: float = parameter(unit="s", low=0.0, high=10.0, scale=0.2)
    spring_per_s2: float = parameter(unit="1/s²", low=0.0, high=100.0, scale=1.0)
    relaxation_s: float = parameter(unit="s", low=0.05, high=10.0, scale=0.5, null=0.5)
    lag_s: float = parameter(unit="s", low=0.0, high=1.0, scale=0.05)
    backlash_m: float = parameter(unit="m", low=0.0, high=0.2, scale=0.01)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with the coasting distance of the library's lag, and with a weak and a stronger spring."""
        lag = max(fitted["accelerate_s"], _SHORTEST_S)
        coasts = min(max(fitted["brake_s"], _SHORTEST_S), 1.0)
        ramp = _TYPICAL_MPS / (2.0 * lag)
        # The distance is v T / (1 + k T R).
        motor = _SHORTEST_S, _BACKLASH_M
        return [
            (ramp, ramp, coasts / max(0.3, 1.0 - spring * coasts * _RELAXATION_S), spring, _RELAXATION_S, *motor)
            for spring in _SPRINGS_PER_S2
        ]

    @staticmethod
    def aim(
        state: Floats,
        forward_mps2: float,
        backward_mps2: float,
        coast_s: float,
        spring_per_s2: float,
        relaxation_s: float,
        lag_s: float,
        backlash_m: float,
    ) -> None:
        """Set limit and lag of the powered drive, or friction and spring of the unpowered one, and the backlash."""
        state[DRIVE_BACKLASH] = backlash_m
        if state[SPEED_AIM] == 0.0:
            state[BRAKE_LAG] = max(state[BRAKE_LAG], coast_s)
            state[COAST_SPRING] = spring_per_s2
        else:
            limit = forward_mps2 if state[SPEED_AIM] > 0.0 else backward_mps2
            state[BODY_ACCELERATION_LIMIT] = min(state[BODY_ACCELERATION_LIMIT], limit)
            state[BODY_BRAKING_LIMIT] = min(state[BODY_BRAKING_LIMIT], limit)
            state[ACCELERATE_LAG] = max(state[ACCELERATE_LAG], lag_s)
            state[BRAKE_LAG] = max(state[BRAKE_LAG], lag_s)
        if spring_per_s2 > 0.0:
            state[COAST_RELAXATION] = relaxation_s
