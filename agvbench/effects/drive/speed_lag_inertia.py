"""Second-order lag of the speed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import ACCELERATE_LAG, BRAKE_LAG, DRIVE_INERTIA
from agvbench.effects.variants import Variant
from agvbench.types import Floats


@dataclass(frozen=True)
class SpeedLagInertia(Variant):
    """Lag of second order: ``inertia_s² v̈ + time_constant_s v̇ = v_map − v``, the same for more and for less speed.

    Its natural frequency is 1 / inertia_s, its damping time_constant_s / (2 inertia_s): below 1 the speed overshoots.
    Without inertia it is speed_lag with equal constants.
    """

    name: ClassVar[str] = "speed_lag_inertia"
    variant_of: ClassVar[str] = "speed_lag"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "acceleration and deceleration are negligible (3.2, assumption 5)"
    reference: ClassVar[str] = (
        "speed controller with integral action on a motor, as in textbooks of control (Ogata 2010, section 5.3)"
    )
    limits: ClassVar[str] = (
        "a linear controller: limits of the force do not act beside it; the drives of steered axles have the other "
        "variants of speed_lag"
    )
    needs_differential: ClassVar[bool] = True
    equivalents: ClassVar[Mapping[str, Mapping[str, float]]] = {
        "speed_lag.accelerate_s": {"time_constant_s": 1.0},
        "speed_lag.brake_s": {"time_constant_s": 1.0},
    }

    time_constant_s: float = parameter(unit="s", low=0.0, high=5.0, scale=0.1)
    inertia_s: float = parameter(unit="s", low=0.0, high=2.0, scale=0.1)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with critical damping, and with little inertia."""
        lag = min(0.5 * (fitted["accelerate_s"] + fitted["brake_s"]), 5.0)
        return [(lag, 0.5 * lag), (lag, 0.2 * lag)]

    @staticmethod
    def aim(state: Floats, time_constant_s: float, inertia_s: float) -> None:
        """Add to the lags of the drive, and set its inertia."""
        state[ACCELERATE_LAG] += time_constant_s
        state[BRAKE_LAG] += time_constant_s
        state[DRIVE_INERTIA] = max(state[DRIVE_INERTIA], inertia_s)
