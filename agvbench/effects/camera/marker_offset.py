"""Offset of the marker centroid."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import HEADING, SEEN_X, SEEN_Y
from agvbench.types import Floats


@dataclass(frozen=True)
class MarkerOffset(Effect):
    """The marker centroid lies `forward_m` in front and `left_m` to the left of its position in the vehicle file."""

    name: ClassVar[str] = "marker_offset"
    stage: ClassVar[Stage] = Stage.CAMERA
    relaxes: ClassVar[str] = "the motion capture system is exact (3.2)"
    reference: ClassVar[str] = "Bentvelsen 2015, table 7.1 (lever arm of the rear angle)"
    limits: ClassVar[str] = (
        "one circle does not distinguish it from heading_misalignment, left_m hardly from wheel_diameter_mismatch"
    )
    remedy: ClassVar[str] = (
        "measure the distances of both axles from the marker centroid, and correct them in campaign.toml or "
        "move the markers"
    )

    forward_m: float = parameter(unit="m", low=-0.5, high=0.5, scale=0.01)
    left_m: float = parameter(unit="m", low=-0.5, high=0.5, scale=0.01)

    @staticmethod
    def see(state: Floats, forward_m: float, left_m: float) -> None:
        """Displace the measured position."""
        if forward_m != 0.0 or left_m != 0.0:
            c, s = math.cos(state[HEADING]), math.sin(state[HEADING])
            state[SEEN_X] += c * forward_m - s * left_m
            state[SEEN_Y] += s * forward_m + c * left_m
