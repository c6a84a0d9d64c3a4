"""Servos with inertia, one of them slower than the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import REAR_LAG_RATIO, STEERING_INERTIA, STEERING_LAG
from agvbench.effects.variants import Variant
from agvbench.types import Floats


@dataclass(frozen=True)
class SteeringLagUneven(Variant):
    """Lag of second order: ``inertia_s² δ̈ + time_constant_s δ̇ = δ_map − δ``; both times ``rear_ratio`` at the rear."""

    name: ClassVar[str] = "steering_lag_uneven"
    variant_of: ClassVar[str] = "steering_lag"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "axles rotate instantaneously (7.3)"
    reference: ClassVar[str] = "second-order actuator, as in textbooks of control (Ogata 2010, section 5.3)"
    limits: ClassVar[str] = "servos of equal damping, at least 0.2; steering_rate_limit does not act beside it"
    needs_steered_axles: ClassVar[bool] = True

    time_constant_s: float = parameter(unit="s", low=0.0, high=5.0, scale=0.1)
    inertia_s: float = parameter(unit="s", low=0.0, high=2.0, scale=0.1)
    rear_ratio: float = parameter(unit="–", low=0.1, high=10.0, scale=0.3, null=1.0)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with critical damping, and with either servo slower."""
        lag = fitted["time_constant_s"]
        return [(1.2 * lag, 0.6 * lag, 0.7), (0.8 * lag, 0.4 * lag, 1.4)]

    @staticmethod
    def aim(state: Floats, time_constant_s: float, inertia_s: float, rear_ratio: float) -> None:
        """Set lag and inertia of the servos."""
        state[STEERING_LAG] = max(state[STEERING_LAG], time_constant_s)
        state[STEERING_INERTIA] = max(state[STEERING_INERTIA], inertia_s)
        state[REAR_LAG_RATIO] *= rear_ratio
