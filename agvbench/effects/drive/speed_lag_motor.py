"""Lag of a motor whose torque falls with speed, and coasting without power."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import ACCELERATE_LAG, BRAKE_LAG, SPEED_AIM
from agvbench.effects.variants import Variant
from agvbench.types import Floats

_SHORTEST_S, _LITTLE, _TYPICAL = 0.01, 0.01, 0.5


@dataclass(frozen=True)
class SpeedLagMotor(Variant):
    """A command sets a force: ``v̇ = (v_map − v) (1 / powered + damping |v_map|)``; without power ``v̇ = −v / coast``.

    The torque of a motor at a duty u falls with its speed: ``m v̇ = F u (1 − v / v₀) − b v``. The speed therefore
    approaches its steady state at the rate ``(F u / v₀ + b) / m``, which grows with the command, and the steady state
    grows with it. At neutral the motor brakes or runs free, at a rate of its own.
    """

    name: ClassVar[str] = "speed_lag_motor"
    variant_of: ClassVar[str] = "speed_lag"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "acceleration and deceleration are negligible (3.2, assumption 5)"
    reference: ClassVar[str] = (
        "speed-torque line of a direct-current motor with viscous friction (Franklin, Powell and Emami-Naeini 2019, "
        "Feedback control of dynamic systems, section 2.3)"
    )
    limits: ClassVar[str] = "without commands to another speed while driving it predicts the same as speed_lag"

    powered_s: float = parameter(unit="s", low=0.0, high=10.0, scale=0.2)
    damping_per_m: float = parameter(unit="1/m", low=0.0, high=100.0, scale=0.2)
    coast_s: float = parameter(unit="s", low=0.0, high=10.0, scale=0.2)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with the library's lags, and with lags that depend on the command."""
        lag = max(0.5 * (fitted["accelerate_s"] + fitted["brake_s"]), _SHORTEST_S)
        return [(lag, _LITTLE, fitted["brake_s"]), (2.0 * lag, _TYPICAL, fitted["brake_s"])]

    @staticmethod
    def aim(state: Floats, powered_s: float, damping_per_m: float, coast_s: float) -> None:
        """Set the lag of the powered drive at this command, or that of the unpowered one."""
        if state[SPEED_AIM] == 0.0:
            state[BRAKE_LAG] = max(state[BRAKE_LAG], coast_s)
        else:
            lag = powered_s / (1.0 + powered_s * damping_per_m * abs(state[SPEED_AIM]))
            state[ACCELERATE_LAG] = max(state[ACCELERATE_LAG], lag)
            state[BRAKE_LAG] = max(state[BRAKE_LAG], lag)
