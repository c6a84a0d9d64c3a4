"""Discrepancy terms of the camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.diagnosis.terms.base import DiscrepancyTerm
from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import SEEN_X, SEEN_Y
from agvbench.types import Floats


@dataclass(frozen=True)
class BentPicture(DiscrepancyTerm):
    """The cameras' scale changes with the square of the distance from a centre."""

    name: ClassVar[str] = "bent_picture"
    stage: ClassVar[Stage] = Stage.CAMERA
    covariates: ClassVar[tuple[str, ...]] = ("x_m", "y_m")
    through: ClassVar[str] = "camera"

    per_m2: float = parameter(unit="1/m²", low=-0.05, high=0.05, scale=0.01)
    x_m: float = parameter(unit="m", low=-3.0, high=3.0, scale=0.5)
    y_m: float = parameter(unit="m", low=-3.0, high=3.0, scale=0.5)

    @staticmethod
    def see(state: Floats, per_m2: float, x_m: float, y_m: float) -> None:
        """Displace the measured position away from the centre."""
        x, y = state[SEEN_X] - x_m, state[SEEN_Y] - y_m
        bend = per_m2 * (x * x + y * y)
        state[SEEN_X] += bend * x
        state[SEEN_Y] += bend * y


@dataclass(frozen=True)
class SkewedPicture(DiscrepancyTerm):
    """The cameras' axes are not at right angles, or have scales of their own: ``x ← x (1 + stretch) + skew y``.

    The heading remains, as that of a rigid body whose markers lie in all directions.
    """

    name: ClassVar[str] = "skewed_picture"
    stage: ClassVar[Stage] = Stage.CAMERA
    covariates: ClassVar[tuple[str, ...]] = ("course_rad", "heading_rad")
    through: ClassVar[str] = "camera"

    skew: float = parameter(unit="–", low=-0.3, high=0.3, scale=0.01)
    stretch: float = parameter(unit="–", low=-0.3, high=0.3, scale=0.01)

    @staticmethod
    def see(state: Floats, skew: float, stretch: float) -> None:
        """Displace the measured position along x."""
        state[SEEN_X] += stretch * state[SEEN_X] + skew * state[SEEN_Y]
