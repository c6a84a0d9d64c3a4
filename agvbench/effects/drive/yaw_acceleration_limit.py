"""Limit of the yaw acceleration of a differential vehicle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import STEERING_RATE
from agvbench.types import Floats


@dataclass(frozen=True)
class YawAccelerationLimit(Effect):
    """The yaw rate changes no faster than a limit: ``|ω̇| ≤ acceleration``.

    With `steering_lag`, the limit applies to the acceleration that the lag requests.
    """

    name: ClassVar[str] = "yaw_acceleration_limit"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "the yaw rate follows its command at once (7.3, for a differential vehicle)"
    reference: ClassVar[str] = (
        "trapezoidal velocity profiles of motion controllers; Siegwart and Nourbakhsh 2011, section 3.6"
    )
    limits: ClassVar[str] = (
        "one limit for both directions of rotation; small steps of the yaw rate hardly depend on it; on a vehicle with "
        "steered axles it would be steering_rate_limit"
    )
    remedy: ClassVar[str] = "raise the limit in the motion controller, or limit steps of the yaw rate in the plan"
    needs_differential: ClassVar[bool] = True

    acceleration_radps2: float = parameter(unit="rad/s²", low=0.05, high=100.0, scale=4.0, null=math.inf)

    @staticmethod
    def aim(state: Floats, acceleration_radps2: float) -> None:
        """Limit how fast the yaw rate changes."""
        state[STEERING_RATE] = min(state[STEERING_RATE], acceleration_radps2)
