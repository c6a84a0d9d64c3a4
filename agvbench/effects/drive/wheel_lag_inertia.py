"""Second-order lag of the driven wheels of a differential vehicle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import ACCELERATE_LAG, BRAKE_LAG, DRIVE_INERTIA, STEERING_INERTIA, STEERING_LAG
from agvbench.effects.variants import Variant
from agvbench.types import Floats


@dataclass(frozen=True)
class WheelLagInertia(Variant):
    """Each wheel has a lag of second order: ``inertia_s² ẅ + time_constant_s ẇ = w_map − w``.

    Speed and yaw rate are the sum and the difference of the wheels' speeds, and obey the same equation. Its natural
    frequency is 1 / inertia_s, its damping time_constant_s / (2 inertia_s); without inertia it is wheel_lag.
    """

    name: ClassVar[str] = "wheel_lag_inertia"
    variant_of: ClassVar[str] = "wheel_lag"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "acceleration is negligible (3.2, assumption 5), and so is that of the yaw rate"
    reference: ClassVar[str] = (
        "speed controller with integral action on a motor, as in textbooks of control (Ogata 2010, section 5.3)"
    )
    limits: ClassVar[str] = (
        "linear controllers: limits of the acceleration and of the yaw acceleration do not act beside it; where runs "
        "begin and end at rest, a response begins like a delay"
    )
    needs_differential: ClassVar[bool] = True

    time_constant_s: float = parameter(unit="s", low=0.0, high=5.0, scale=0.1)
    inertia_s: float = parameter(unit="s", low=0.0, high=2.0, scale=0.1)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with critical damping, and with little inertia."""
        lag = fitted["time_constant_s"]
        return [(lag, 0.5 * lag), (lag, 0.2 * lag)]

    @staticmethod
    def aim(state: Floats, time_constant_s: float, inertia_s: float) -> None:
        """Add to the lags of the yaw rate and of the speed, and set the inertia of both."""
        state[STEERING_LAG] += time_constant_s
        state[ACCELERATE_LAG] += time_constant_s
        state[BRAKE_LAG] += time_constant_s
        state[STEERING_INERTIA] = max(state[STEERING_INERTIA], inertia_s)
        state[DRIVE_INERTIA] = max(state[DRIVE_INERTIA], inertia_s)
