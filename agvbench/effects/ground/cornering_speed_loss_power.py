"""Loss of speed by a power of the angle's tangent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import DRAGGED, FRONT_SPEED, REAR_SPEED, TAN_FRONT, TAN_REAR
from agvbench.effects.variants import Variant
from agvbench.types import Floats


@dataclass(frozen=True)
class CorneringSpeedLossPower(Variant):
    """Speed falls with a power of the angle: ``v ← v (1 − loss (|tan δf|ᵖ + |tan δr|ᵖ))``; the library has p = 1."""

    name: ClassVar[str] = "cornering_speed_loss_power"
    variant_of: ClassVar[str] = "cornering_speed_loss"
    stage: ClassVar[Stage] = Stage.WHEELS
    relaxes: ClassVar[str] = "speed does not depend on steering (7.4)"
    reference: ClassVar[str] = "Bentvelsen 2015, appendix B; the power is agvbench's own"
    limits: ClassVar[str] = "the same power for both axles"

    loss: float = parameter(unit="–", low=0.0, high=0.9, scale=0.1)
    exponent: float = parameter(unit="–", low=0.3, high=4.0, scale=1.0, null=1.0)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start near the library's equation, and with twice the loss at the square."""
        return [(fitted["loss"], 1.2), (2.0 * fitted["loss"], 2.0)]

    @staticmethod
    def drive(state: Floats, loss: float, exponent: float) -> None:
        """Scale both axle speeds."""
        if loss != 0.0:
            factor = 1.0 - loss * (abs(state[TAN_FRONT]) ** exponent + abs(state[TAN_REAR]) ** exponent)
            state[FRONT_SPEED] *= factor
            state[REAR_SPEED] *= factor
            state[DRAGGED] *= factor
