"""Steered wheels cost speed by a power of the angle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.state import FRONT, FRONT_SPEED, REAR, REAR_SPEED
from agvbench.effects.variants.cornering_speed_loss_power import CorneringSpeedLossPower
from agvbench.types import Floats


@dataclass(frozen=True)
class CorneringSpeedLossAngle(CorneringSpeedLossPower):
    """Speed falls with a power of the angle: ``v ← v (1 − loss (|δf|ᵖ + |δr|ᵖ))``, angles in rad."""

    name: ClassVar[str] = "cornering_speed_loss_angle"

    @staticmethod
    def drive(state: Floats, loss: float, exponent: float) -> None:
        """Slow both axles."""
        if loss != 0.0:
            left = 1.0 - loss * (abs(state[FRONT]) ** exponent + abs(state[REAR]) ** exponent)
            state[FRONT_SPEED] *= left
            state[REAR_SPEED] *= left
