"""Lag of the driven wheels of a differential vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import ACCELERATE_LAG, BRAKE_LAG, STEERING_LAG
from agvbench.types import Floats


@dataclass(frozen=True)
class WheelLag(Effect):
    """Each driven wheel follows its speed with a first-order lag: ``ẇ = (w_map − w) / time_constant_s``.

    Speed and yaw rate are the sum and the difference of the wheels' speeds, and have the same lag. It adds to those of
    `speed_lag` and `steering_lag`, which controllers of the body's speed and yaw rate have.
    """

    name: ClassVar[str] = "wheel_lag"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "acceleration is negligible (3.2, assumption 5), and so is that of the yaw rate"
    reference: ClassVar[str] = "first-order model of a motor with its speed controller, as in textbooks of control"
    limits: ClassVar[str] = (
        "speed_lag and steering_lag of equal constants are the same; a short one looks like actuation_delay or "
        "mocap_latency"
    )
    remedy: ClassVar[str] = "tune the speed controllers of the wheels, or start turns earlier by the lag"
    needs_differential: ClassVar[bool] = True

    time_constant_s: float = parameter(unit="s", low=0.0, high=5.0, scale=0.1)

    @staticmethod
    def aim(state: Floats, time_constant_s: float) -> None:
        """Add to the lags of the yaw rate and of the speed."""
        state[STEERING_LAG] += time_constant_s
        state[ACCELERATE_LAG] += time_constant_s
        state[BRAKE_LAG] += time_constant_s
