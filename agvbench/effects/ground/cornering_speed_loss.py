"""Loss of speed with steered wheels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import DRAGGED, FRONT_SPEED, REAR_SPEED, TAN_FRONT, TAN_REAR
from agvbench.types import Floats


@dataclass(frozen=True)
class CorneringSpeedLoss(Effect):
    """Speed falls with the angle of the axles: ``v ← v (1 − loss (|tan δf| + |tan δr|))``."""

    name: ClassVar[str] = "cornering_speed_loss"
    stage: ClassVar[Stage] = Stage.WHEELS
    relaxes: ClassVar[str] = "speed does not depend on steering (7.4)"
    reference: ClassVar[str] = "Bentvelsen 2015, appendix B (cornering speed)"
    limits: ClassVar[str] = "other equations (in the square of the angle, in curvature) differ at large angles"
    remedy: ClassVar[str] = (
        "check wheels for scrub in turns (toe, Ackermann geometry, tyres), or plan turns with the lower speed"
    )
    needs_steered_axles: ClassVar[bool] = True

    loss: float = parameter(unit="–", low=0.0, high=0.7, scale=0.1)

    @staticmethod
    def drive(state: Floats, loss: float) -> None:
        """Scale both axle speeds."""
        factor = 1.0 - loss * (abs(state[TAN_FRONT]) + abs(state[TAN_REAR]))
        state[FRONT_SPEED] *= factor
        state[REAR_SPEED] *= factor
        state[DRAGGED] *= factor
