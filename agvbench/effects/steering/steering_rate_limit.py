"""Rate limit of the servos."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import STEERING_RATE
from agvbench.types import Floats


@dataclass(frozen=True)
class SteeringRateLimit(Effect):
    """Servos turn at no more than a fixed rate: ``|δ̇| ≤ rate``.

    With `steering_lag`, the limit applies to the rate that the lag requests.
    """

    name: ClassVar[str] = "steering_rate_limit"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "axles rotate instantaneously (7.3)"
    reference: ClassVar[str] = "slew rate of hobby servos, stated as seconds per 60°; Bentvelsen 2015, section 7.3"
    limits: ClassVar[str] = "one rate for both axles and both directions; small steps of steering hardly depend on it"
    remedy: ClassVar[str] = (
        "let the servos settle before driving off, limit steps of steering in the plan, or check the supply "
        "voltage of the servos"
    )
    needs_steered_axles: ClassVar[bool] = True

    rate_rad_per_s: float = parameter(unit="rad/s", low=0.01, high=100.0, scale=2.0, null=math.inf)

    @staticmethod
    def aim(state: Floats, rate_rad_per_s: float) -> None:
        """Set the rate limit of the servos."""
        state[STEERING_RATE] = min(state[STEERING_RATE], rate_rad_per_s)
