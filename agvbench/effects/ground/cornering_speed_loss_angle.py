"""Loss of speed by a power of the axle angle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.ground.cornering_speed_loss_power import CorneringSpeedLossPower
from agvbench.effects.state import DRAGGED, FRONT, FRONT_SPEED, REAR, REAR_SPEED
from agvbench.types import Floats


@dataclass(frozen=True)
class CorneringSpeedLossAngle(CorneringSpeedLossPower):
    """Speed falls with a power of the angle: ``v ← v (1 − loss (|δf|ᵖ + |δr|ᵖ))``, angles in rad."""

    name: ClassVar[str] = "cornering_speed_loss_angle"

    @staticmethod
    def drive(state: Floats, loss: float, exponent: float) -> None:
        """Scale both axle speeds."""
        if loss != 0.0:
            factor = 1.0 - loss * (abs(state[FRONT]) ** exponent + abs(state[REAR]) ** exponent)
            state[FRONT_SPEED] *= factor
            state[REAR_SPEED] *= factor
            state[DRAGGED] *= factor
