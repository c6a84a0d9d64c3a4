"""Unequal wheel diameters left and right."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import FORWARD, LEFT, YAW_RATE
from agvbench.types import Floats


@dataclass(frozen=True)
class WheelDiameterMismatch(Effect):
    """Left and right wheels differ, so the vehicle turns by itself: ``κ ← κ + curvature``."""

    name: ClassVar[str] = "wheel_diameter_mismatch"
    stage: ClassVar[Stage] = Stage.BODY
    relaxes: ClassVar[str] = "wheel size is negligible (3.2)"
    reference: ClassVar[str] = (
        "Borenstein and Feng 1996, IEEE Trans. Robotics and Automation 12(6) (UMBmark, unequal wheel diameters)"
    )
    limits: ClassVar[str] = (
        "nearly the same as an offset of both maps or as markers off the centre line: "
        "tight circles both ways distinguish them"
    )
    remedy: ClassVar[str] = "compare diameters and tyre pressures of left and right wheels, and the toe of both axles"

    curvature_per_m: float = parameter(unit="1/m", low=-1.0, high=1.0, scale=0.02)

    @staticmethod
    def move(state: Floats, curvature_per_m: float) -> None:
        """Add the curvature to the path of the centroid, forward and backward alike."""
        if curvature_per_m != 0.0:
            speed = math.copysign(math.hypot(state[FORWARD], state[LEFT]), state[FORWARD])
            state[YAW_RATE] += curvature_per_m * speed
