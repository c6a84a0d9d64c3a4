"""Misalignment of the measured heading."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import SEEN_HEADING
from agvbench.types import Floats


@dataclass(frozen=True)
class HeadingMisalignment(Effect):
    """Measured heading = heading + angle: the rigid body was defined with the vehicle at an angle."""

    name: ClassVar[str] = "heading_misalignment"
    stage: ClassVar[Stage] = Stage.CAMERA
    relaxes: ClassVar[str] = "the motion capture system is exact (3.2)"
    reference: ClassVar[str] = "definition of a rigid body's axes in motion capture"
    limits: ClassVar[str] = (
        "equal offsets of both axles' maps make the same paths: only the neutral of the vehicle file distinguishes them"
    )
    remedy: ClassVar[str] = (
        "define the rigid body of the motion capture system again, with its x axis along the vehicle"
    )

    angle_rad: float = parameter(unit="rad", low=-0.5, high=0.5, scale=0.02)

    @staticmethod
    def see(state: Floats, angle_rad: float) -> None:
        """Rotate the measured heading."""
        state[SEEN_HEADING] += angle_rad
