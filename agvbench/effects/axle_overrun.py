"""Braking by the slower of both axles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import COS_FRONT, COS_REAR, FORWARD, FRONT_SPEED, LEFT, REAR_SPEED, YAW_RATE
from agvbench.types import Floats


@dataclass(frozen=True)
class AxleOverrun(Effect):
    """The axle that is slower than the body brakes it more stiffly than the other axle pulls it.

    Each axle pulls towards its own ``w cos δ``; the slower one counts ``1 + excess`` times:
    ``v cos β = ((1 + excess) slower + faster) / (2 + excess)``. At 0 that is equation 5.6.
    """

    name: ClassVar[str] = "axle_overrun"
    stage: ClassVar[Stage] = Stage.BODY
    relaxes: ClassVar[str] = "speed does not depend on steering (7.4)"
    reference: ClassVar[str] = "Bentvelsen 2015, equation 5.6 and appendix B; the equation is agvbench's own"
    limits: ClassVar[str] = "no influence where both axles steer by the same angle; cornering_speed_loss has one"
    remedy: ClassVar[str] = (
        "check whether the motor controller of one axle brakes what the other drives; let both coast, or "
        "control both to the same speed of the body"
    )

    excess: float = parameter(unit="–", low=0.0, high=20.0, scale=1.0)
    needs_both_axles_driven: ClassVar[bool] = True

    @staticmethod
    def move(state: Floats, excess: float) -> None:
        """Scale the motion of the body by the braking of the slower axle."""
        front, rear = abs(state[FRONT_SPEED]) * state[COS_FRONT], abs(state[REAR_SPEED]) * state[COS_REAR]
        total = front + rear
        if excess > 0.0 and total > 0.0:
            factor = 2.0 * (total + excess * min(front, rear)) / ((2.0 + excess) * total)
            state[FORWARD] *= factor
            state[LEFT] *= factor
            state[YAW_RATE] *= factor
