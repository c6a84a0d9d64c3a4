"""Lateral slip of the tyres (understeer)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import FORWARD, LEFT, YAW_RATE
from agvbench.types import Floats


@dataclass(frozen=True)
class LateralSlip(Effect):
    """Tyres slip laterally under lateral force: ``κ ← κ / (1 + gradient v²)``, v the speed of the centroid."""

    name: ClassVar[str] = "lateral_slip"
    stage: ClassVar[Stage] = Stage.BODY
    relaxes: ClassVar[str] = "slip is negligible (3.2)"
    reference: ClassVar[str] = "Gillespie 1992, Fundamentals of Vehicle Dynamics, ch. 6 (understeer gradient)"
    limits: ClassVar[str] = (
        "steady turning at one gradient; the centroid's direction in the vehicle frame stays that of the kinematics"
    )
    remedy: ClassVar[str] = "drive turns more slowly, or fit tyres with more grip; a run at another speed confirms it"

    gradient: float = parameter(unit="s²/m²", low=-0.2, high=20.0, scale=0.5)

    @staticmethod
    def move(state: Floats, gradient: float) -> None:
        """Reduce the yaw rate with the square of the speed."""
        square = state[FORWARD] * state[FORWARD] + state[LEFT] * state[LEFT]
        state[YAW_RATE] /= 1.0 + gradient * square
