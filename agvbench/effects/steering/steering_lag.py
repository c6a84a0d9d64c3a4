"""First-order lag of the axle angles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import STEERING_LAG
from agvbench.types import Floats


@dataclass(frozen=True)
class SteeringLag(Effect):
    """First-order lag of both axles behind their servos' static maps: ``δ̇ = (δ_map − δ) / time_constant_s``."""

    name: ClassVar[str] = "steering_lag"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "axles rotate instantaneously (7.3)"
    reference: ClassVar[str] = "first-order actuator, as in textbooks of control"
    limits: ClassVar[str] = (
        "invisible where steering is set before the vehicle moves; a servo of second order looks like lag and delay"
    )
    remedy: ClassVar[str] = (
        "let the servos settle before driving off, limit steps of steering in the plan, or fit faster servos"
    )

    time_constant_s: float = parameter(unit="s", low=0.0, high=5.0, scale=0.1)

    @staticmethod
    def aim(state: Floats, time_constant_s: float) -> None:
        """Set the lag of the servos."""
        state[STEERING_LAG] = time_constant_s
