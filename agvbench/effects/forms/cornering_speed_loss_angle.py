"""Steered wheels cost speed by a power of the angle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.forms.base import Form
from agvbench.effects.state import FRONT, FRONT_SPEED, REAR, REAR_SPEED
from agvbench.types import Floats


@dataclass(frozen=True)
class CorneringSpeedLossAngle(Form):
    """Speed falls with a power of the angle: ``v ← v (1 − loss (|δf|ᵖ + |δr|ᵖ))``, angles in rad."""

    name: ClassVar[str] = "cornering_speed_loss_angle"
    form_of: ClassVar[str] = "cornering_speed_loss"
    stage: ClassVar[Stage] = Stage.WHEELS
    relaxes: ClassVar[str] = "speed does not depend on steering (7.4)"
    reference: ClassVar[str] = "Bentvelsen 2015, appendix B; the power is our own"
    limits: ClassVar[str] = "the same power for both axles"

    loss: float = parameter(unit="–", low=-0.5, high=0.9, scale=0.1)
    exponent: float = parameter(unit="–", low=0.3, high=4.0, scale=1.0, null=1.0)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Begin near the library's law, and with twice the loss at the square."""
        return [(fitted["loss"], 1.2), (2.0 * fitted["loss"], 2.0)]

    @staticmethod
    def drive(state: Floats, loss: float, exponent: float) -> None:
        """Slow both axles."""
        if loss != 0.0:
            left = 1.0 - loss * (abs(state[FRONT]) ** exponent + abs(state[REAR]) ** exponent)
            state[FRONT_SPEED] *= left
            state[REAR_SPEED] *= left
