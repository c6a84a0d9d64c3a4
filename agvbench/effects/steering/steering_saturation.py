"""End stops of the axles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import FRONT_AIM, REAR_AIM
from agvbench.types import Floats


@dataclass(frozen=True)
class SteeringSaturation(Effect):
    """No axle turns further than its end stops: ``|δ| ≤ limit`` for the commanded angle."""

    name: ClassVar[str] = "steering_saturation"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "a line describes the servo (7.3)"
    reference: ClassVar[str] = "Bentvelsen 2015, tables 7.1 and 7.2 (outermost points)"
    limits: ClassVar[str] = "a static map with end stops contains it: use it only beside a linear map"
    remedy: ClassVar[str] = "move the end stops, or plan within the smaller range of angles"
    needs_steered_axles: ClassVar[bool] = True

    front_rad: float = parameter(unit="rad", low=0.01, high=1.5, scale=0.6, null=math.inf)
    rear_rad: float = parameter(unit="rad", low=0.01, high=1.5, scale=0.6, null=math.inf)

    @staticmethod
    def aim(state: Floats, front_rad: float, rear_rad: float) -> None:
        """Limit both aims."""
        state[FRONT_AIM] = min(front_rad, max(-front_rad, state[FRONT_AIM]))
        state[REAR_AIM] = min(rear_rad, max(-rear_rad, state[REAR_AIM]))
