"""First-order lag of the speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import ACCELERATE_LAG, BRAKE_LAG
from agvbench.types import Floats


@dataclass(frozen=True)
class SpeedLag(Effect):
    """First-order lag of the axle speed: ``v̇ = (v_map − v) / T``.

    T is ``accelerate_s`` where |v| grows and ``brake_s`` where it falls. From forward to backward the vehicle brakes to
    rest first and accelerates then. The thesis measured 0.29 s from 0 to 0.3 m/s, and 0.59 s from 0.32 to 0.02 m/s
    (section 8.1).
    """

    name: ClassVar[str] = "speed_lag"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "acceleration and deceleration are negligible (3.2, assumption 5)"
    reference: ClassVar[str] = "Bentvelsen 2015, section 8.1"
    limits: ClassVar[str] = "ramps limited by force look like a longer lag at larger steps of speed"
    remedy: ClassVar[str] = (
        "plan with the distances of acceleration and braking, or change the ramps of the motor controller"
    )

    accelerate_s: float = parameter(unit="s", low=0.0, high=10.0, scale=0.2)
    brake_s: float = parameter(unit="s", low=0.0, high=10.0, scale=0.2)

    @staticmethod
    def aim(state: Floats, accelerate_s: float, brake_s: float) -> None:
        """Set the lags of the drive."""
        state[ACCELERATE_LAG] = accelerate_s
        state[BRAKE_LAG] = brake_s
