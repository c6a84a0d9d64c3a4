"""Second-order lag of the axle angles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import STEERING_INERTIA, STEERING_LAG
from agvbench.effects.variants import Variant
from agvbench.types import Floats


@dataclass(frozen=True)
class SteeringLagInertia(Variant):
    """Lag of second order: ``inertia_s² δ̈ + time_constant_s δ̇ = δ_map − δ``; without inertia it is steering_lag.

    Its natural frequency is 1 / inertia_s, its damping time_constant_s / (2 inertia_s): below 1 the axle oscillates.
    """

    name: ClassVar[str] = "steering_lag_inertia"
    variant_of: ClassVar[str] = "steering_lag"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "axles rotate instantaneously (7.3)"
    reference: ClassVar[str] = "second-order actuator, as in textbooks of control (Ogata 2010, section 5.3)"
    limits: ClassVar[str] = (
        "a linear servo with a damping ratio of at least 0.2; steering_rate_limit does not act beside it"
    )

    time_constant_s: float = parameter(unit="s", low=0.0, high=5.0, scale=0.1)
    inertia_s: float = parameter(unit="s", low=0.0, high=2.0, scale=0.1)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with critical damping, and with little inertia."""
        lag = fitted["time_constant_s"]
        return [(lag, 0.5 * lag), (lag, 0.2 * lag)]

    @staticmethod
    def aim(state: Floats, time_constant_s: float, inertia_s: float) -> None:
        """Set lag and inertia of the servos."""
        state[STEERING_LAG] = max(state[STEERING_LAG], time_constant_s)
        state[STEERING_INERTIA] = inertia_s
