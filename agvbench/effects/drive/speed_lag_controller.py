"""A speed controller that overshoots, and a brake at neutral."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import ACCELERATE_LAG, BRAKE_LAG, DRIVE_INERTIA, SPEED_AIM
from agvbench.effects.variants import Variant
from agvbench.types import Floats


@dataclass(frozen=True)
class SpeedLagController(Variant):
    """A controller with integral action under power: ``inertia_s² v̈ + time_constant_s v̇ = v_map − v``.

    At neutral ``v̇ = −v / coast_s``. The natural frequency of the controller is 1 / inertia_s, its damping
    time_constant_s / (2 inertia_s): below 1 the speed overshoots.
    """

    name: ClassVar[str] = "speed_lag_controller"
    variant_of: ClassVar[str] = "speed_lag"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "acceleration and deceleration are negligible (3.2, assumption 5)"
    reference: ClassVar[str] = (
        "speed controller with integral action on a motor, as in textbooks of control (Ogata 2010, section 5.3)"
    )
    limits: ClassVar[str] = "a linear controller: limits of the force do not act beside it"
    needs_steered_axles: ClassVar[bool] = True

    time_constant_s: float = parameter(unit="s", low=0.0, high=5.0, scale=0.1)
    inertia_s: float = parameter(unit="s", low=0.0, high=2.0, scale=0.1)
    coast_s: float = parameter(unit="s", low=0.0, high=10.0, scale=0.1)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with a damping of 0.3, and with critical damping."""
        lag, coasts = min(max(fitted["accelerate_s"], 0.05), 5.0), fitted["brake_s"]
        return [(lag, lag / 0.6, coasts), (lag, 0.5 * lag, coasts)]

    @staticmethod
    def aim(state: Floats, time_constant_s: float, inertia_s: float, coast_s: float) -> None:
        """Set lag and inertia of the powered drive, or the lag of the unpowered one."""
        if state[SPEED_AIM] == 0.0:
            state[BRAKE_LAG] = max(state[BRAKE_LAG], coast_s)
        else:
            state[ACCELERATE_LAG] = max(state[ACCELERATE_LAG], time_constant_s)
            state[BRAKE_LAG] = max(state[BRAKE_LAG], time_constant_s)
            state[DRIVE_INERTIA] = max(state[DRIVE_INERTIA], inertia_s)
