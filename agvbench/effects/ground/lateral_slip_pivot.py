"""Lateral slip about another point than the marker centroid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import FORWARD, LEFT, YAW_RATE
from agvbench.effects.variants import Variant
from agvbench.types import Floats

_BESIDE_M = 0.05


@dataclass(frozen=True)
class LateralSlipPivot(Variant):
    """Curvature falls as in the library; the point that keeps its direction of motion lies `pivot_m` ahead.

    The slip of each axle is proportional to its own lateral force. The point between the axles whose direction does
    not change therefore depends on the load and the tyres of both; the library puts it at the marker centroid.
    """

    name: ClassVar[str] = "lateral_slip_pivot"
    variant_of: ClassVar[str] = "lateral_slip"
    stage: ClassVar[Stage] = Stage.BODY
    relaxes: ClassVar[str] = "slip is negligible (3.2)"
    reference: ClassVar[str] = "Gillespie 1992, ch. 6: slip angles of both axles in steady turning"
    limits: ClassVar[str] = "steady turning; at one speed it is a scale of the steering and marker_offset"

    gradient: float = parameter(unit="s²/m²", low=-0.2, high=20.0, scale=0.5)
    pivot_m: float = parameter(unit="m", low=-0.5, high=0.5, scale=0.05)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with a point on either side of the marker centroid."""
        return [(fitted["gradient"], _BESIDE_M), (fitted["gradient"], -_BESIDE_M)]

    @staticmethod
    def move(state: Floats, gradient: float, pivot_m: float) -> None:
        """Reduce the yaw rate with the square of the speed, and turn about the pivot."""
        square = state[FORWARD] * state[FORWARD] + state[LEFT] * state[LEFT]
        yaw_rate = state[YAW_RATE] / (1.0 + gradient * square)
        state[LEFT] += (state[YAW_RATE] - yaw_rate) * pivot_m
        state[YAW_RATE] = yaw_rate
