"""Rate limits of the servos to either side."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import RIGHT_RATE_RATIO, STEERING_RATE
from agvbench.effects.variants import Variant
from agvbench.types import Floats


@dataclass(frozen=True)
class SteeringRateLimitSides(Variant):
    """Servos turn faster to one side: ``δ̇ ≤ rate`` to the left, and ``−δ̇ ≤ right_ratio · rate`` to the right."""

    name: ClassVar[str] = "steering_rate_limit_sides"
    variant_of: ClassVar[str] = "steering_rate_limit"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "axles rotate instantaneously (7.3)"
    reference: ClassVar[str] = "slew rate of hobby servos, stated as seconds per 60°; a spring beside the servo"
    limits: ClassVar[str] = "one ratio for both axles; small steps of steering hardly depend on it"
    needs_steered_axles: ClassVar[bool] = True

    rate_rad_per_s: float = parameter(unit="rad/s", low=0.01, high=100.0, scale=2.0, null=math.inf)
    right_ratio: float = parameter(unit="–", low=0.01, high=100.0, scale=1.0, null=1.0)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with servos that are slow to the left, and to the right."""
        rate = fitted["rate_rad_per_s"]
        return [(0.7 * rate, 5.0), (3.5 * rate, 0.2)]

    @staticmethod
    def aim(state: Floats, rate_rad_per_s: float, right_ratio: float) -> None:
        """Set both limits of the servos."""
        state[STEERING_RATE] = min(state[STEERING_RATE], rate_rad_per_s)
        state[RIGHT_RATE_RATIO] *= right_ratio
