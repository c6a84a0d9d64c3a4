"""Scale error of the motion capture system."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import SEEN_X, SEEN_Y
from agvbench.types import Floats


@dataclass(frozen=True)
class MocapScale(Effect):
    """Measured position = (1 + scale) · position, about the origin of the floor frame."""

    name: ClassVar[str] = "mocap_scale"
    stage: ClassVar[Stage] = Stage.CAMERA
    relaxes: ClassVar[str] = "the motion capture system does not drift (9.2)"
    reference: ClassVar[str] = "calibration wand length of motion capture systems"
    limits: ClassVar[str] = (
        "a scale of all speeds and of the vehicle's own lengths: only turning distinguishes it from the drive's map"
    )
    remedy: ClassVar[str] = (
        "calibrate the motion capture system with its wand; a measured distance on the floor confirms it"
    )

    scale: float = parameter(unit="–", low=-0.2, high=0.2, scale=0.02)

    @staticmethod
    def see(state: Floats, scale: float) -> None:
        """Scale the measured position."""
        state[SEEN_X] *= 1.0 + scale
        state[SEEN_Y] *= 1.0 + scale
