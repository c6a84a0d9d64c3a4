"""Rate and acceleration limits of the servos."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import STEERING_ACCELERATION, STEERING_RATE
from agvbench.effects.variants import Variant
from agvbench.types import Floats


@dataclass(frozen=True)
class SteeringRateLimitAcceleration(Variant):
    """Servos approach their command as fast as ``|δ̇| ≤ rate`` and ``|δ̈| ≤ acceleration`` allow, and stop there."""

    name: ClassVar[str] = "steering_rate_limit_acceleration"
    variant_of: ClassVar[str] = "steering_rate_limit"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "axles rotate instantaneously (7.3)"
    reference: ClassVar[str] = "trapezoidal profile of velocity (Biagiotti and Melchiorri 2008, section 3.2)"
    limits: ClassVar[str] = "steering_lag does not act beside it; in small steps of steering the rate is not reached"

    rate_rad_per_s: float = parameter(unit="rad/s", low=0.01, high=100.0, scale=2.0, null=math.inf)
    acceleration_rad_per_s2: float = parameter(unit="rad/s²", low=0.1, high=1000.0, scale=20.0, null=math.inf)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with servos that reach the library's rate in 0.2 s, and in 0.05 s."""
        rate = fitted["rate_rad_per_s"]
        return [(rate, rate / 0.2), (rate, rate / 0.05)]

    @staticmethod
    def aim(state: Floats, rate_rad_per_s: float, acceleration_rad_per_s2: float) -> None:
        """Set the limits of the servos."""
        state[STEERING_RATE] = min(state[STEERING_RATE], rate_rad_per_s)
        state[STEERING_ACCELERATION] = acceleration_rad_per_s2
