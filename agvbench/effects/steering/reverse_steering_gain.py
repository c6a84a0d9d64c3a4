"""Different steering gain in reverse."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import FRONT, REAR, SPEED
from agvbench.types import Floats


@dataclass(frozen=True)
class ReverseSteeringGain(Effect):
    """In reverse the wheel forces change sign, and compliance changes the angle: ``δ ← (1 + gain) δ``."""

    name: ClassVar[str] = "reverse_steering_gain"
    stage: ClassVar[Stage] = Stage.WHEELS
    relaxes: ClassVar[str] = "parts are tight (3.2)"
    reference: ClassVar[str] = (
        "Bentvelsen 2015, chapter 8 (backward turns); Dixon 1996, Tires, Suspension and Handling (compliance steer)"
    )
    limits: ClassVar[str] = "needs runs in both directions; one gain for both axles"
    remedy: ClassVar[str] = "tighten the steering linkage: under load it yields in one direction of travel"
    needs_steered_axles: ClassVar[bool] = True

    gain: float = parameter(unit="–", low=-0.5, high=0.5, scale=0.05)

    @staticmethod
    def steer(state: Floats, gain: float) -> None:
        """Scale both angles while the drive runs backward."""
        if state[SPEED] < 0.0:
            state[FRONT] *= 1.0 + gain
            state[REAR] *= 1.0 + gain
