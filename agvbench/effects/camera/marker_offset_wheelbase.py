"""Offset of the marker centroid on a vehicle whose wheelbase was measured wrongly, too."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import FORWARD, LEFT, TAN_FRONT, TAN_REAR, YAW_RATE
from agvbench.effects.variants import Variant
from agvbench.types import Floats

_SHARE = 0.01


@dataclass(frozen=True)
class MarkerOffsetWheelbase(Variant):
    """As the library's offset, and the wheelbase is longer by a share: each axle is half of that farther away.

    Distances of both axles are measured one by one, each with an error of its own.
    """

    name: ClassVar[str] = "marker_offset_wheelbase"
    variant_of: ClassVar[str] = "marker_offset"
    stage: ClassVar[Stage] = Stage.BODY
    relaxes: ClassVar[str] = "the motion capture system is exact (3.2)"
    reference: ClassVar[str] = "Bentvelsen 2015, eq. 5.6–5.8 with other distances of the axles"
    limits: ClassVar[str] = "axle_coupling of both axles turns the vehicle in the same way"
    equivalents: ClassVar[Mapping[str, Mapping[str, float]]] = {"wheelbase_error.longer": {"longer": 1.0}}
    needs_steered_axles: ClassVar[bool] = True

    forward_m: float = parameter(unit="m", low=-0.5, high=0.5, scale=0.01)
    left_m: float = parameter(unit="m", low=-0.5, high=0.5, scale=0.01)
    longer: float = parameter(unit="–", low=-0.3, high=0.3, scale=0.02)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with a slightly longer and with a slightly shorter wheelbase."""
        return [(fitted["forward_m"], fitted["left_m"], share) for share in (_SHARE, -_SHARE)]

    @staticmethod
    def move(state: Floats, forward_m: float, left_m: float, longer: float) -> None:
        """Turn as with the other wheelbase, and move the marker centroid as a point of the rigid body."""
        shift = 0.5 * longer * (state[TAN_FRONT] + state[TAN_REAR]) * state[FORWARD]
        state[LEFT] = (state[LEFT] + shift) / (1.0 + longer)
        state[YAW_RATE] /= 1.0 + longer
        state[LEFT] += state[YAW_RATE] * forward_m
        state[FORWARD] -= state[YAW_RATE] * left_m
