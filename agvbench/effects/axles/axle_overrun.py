"""Braking by the slower of both axles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import COS_FRONT, COS_REAR, DRAGGED, FORWARD, FRONT_SPEED, LEFT, REAR_SPEED, YAW_RATE
from agvbench.types import Floats


@dataclass(frozen=True)
class AxleOverrun(Effect):
    """The axle that is slower than the body brakes it more stiffly than the other axle pulls it.

    Each axle pulls towards its own ``w cos δ``; the slower one counts ``1 + excess`` times:
    ``v cos β = ((1 + excess) slower + faster) / (2 + excess)``. At 0 that is equation 5.6. The drag D of turned wheels
    (cornering_speed_loss) acts against both axles: ``v cos β = ((1 + excess) slower + faster − 2 D) / (2 + excess)``,
    or ``(slower + faster) / 2 − D`` where D is so large that no axle brakes the body.
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
    needs_steered_axles: ClassVar[bool] = True

    excess: float = parameter(unit="–", low=0.0, high=20.0, scale=1.0)
    needs_both_axles_driven: ClassVar[bool] = True

    @staticmethod
    def move(state: Floats, excess: float) -> None:
        """Scale the motion of the body by the braking of the slower axle."""
        left = state[DRAGGED]
        front, rear = abs(state[FRONT_SPEED]) * state[COS_FRONT], abs(state[REAR_SPEED]) * state[COS_REAR]
        total, drag = front + rear, 0.5 * (1.0 / left - 1.0) * (front + rear)
        apart = abs(front - rear) / left
        if excess > 0.0 and total > 0.0 and drag < 0.5 * apart:
            # The slower axle brakes the body from where drag alone would leave it to its own speed, and no further.
            factor = 1.0 - excess * (apart - 2.0 * drag) / ((2.0 + excess) * total)
            state[FORWARD] *= factor
            state[LEFT] *= factor
            state[YAW_RATE] *= factor
