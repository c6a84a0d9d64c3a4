"""A differential between both axles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import COS_FRONT, COS_REAR, FORWARD, LEFT, YAW_RATE
from agvbench.types import Floats


@dataclass(frozen=True)
class AxleDifferential(Effect):
    """A differential between the axles keeps the mean of their wheel speeds: ``w = v cos β (1/cos δf + 1/cos δr) / 2``.

    The body then moves at the harmonic mean of both ``w cos δ``, where equation 5.6 has their arithmetic mean:
    ``v ← v (1 − share ((cos δf − cos δr) / (cos δf + cos δr))²)``, with a share of 1. Software that gives each axle the
    speed of rolling without slip is such a differential, too.
    """

    name: ClassVar[str] = "axle_differential"
    stage: ClassVar[Stage] = Stage.BODY
    relaxes: ClassVar[str] = "both axles turn at the speed of the drive (5.6)"
    reference: ClassVar[str] = "an open differential: its input turns at the mean of the speeds of its outputs"
    limits: ClassVar[str] = "none where both axles steer by the same angle; a share above 1 is another loss in turns"
    remedy: ClassVar[str] = (
        "nothing is broken: keep the effect in the vehicle's file, or lock the differential between the axles if the "
        "speed must be that of equation 5.6"
    )
    needs_steered_axles: ClassVar[bool] = True
    needs_both_axles_driven: ClassVar[bool] = True

    share: float = parameter(unit="–", low=0.0, high=1.5, scale=0.5)

    @staticmethod
    def move(state: Floats, share: float) -> None:
        """Scale the motion of the body by the ratio of both means."""
        apart = (state[COS_FRONT] - state[COS_REAR]) / (state[COS_FRONT] + state[COS_REAR])
        factor = 1.0 - share * apart * apart
        state[FORWARD] *= factor
        state[LEFT] *= factor
        state[YAW_RATE] *= factor
