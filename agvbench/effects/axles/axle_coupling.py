"""Mechanical coupling of the axles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import FRONT, REAR
from agvbench.types import Floats


@dataclass(frozen=True)
class AxleCoupling(Effect):
    """The axles are coupled: ``δf ← δf + front_from_rear · δr`` and ``δr ← δr + rear_from_front · δf``."""

    name: ClassVar[str] = "axle_coupling"
    stage: ClassVar[Stage] = Stage.WHEELS
    relaxes: ClassVar[str] = "parts are tight (3.2)"
    reference: ClassVar[str] = "Bentvelsen 2015, table 7.1 (the rear angle drifts while the front turns)"
    limits: ClassVar[str] = "markers off the centre line (marker_offset) cause the same drift where only one axle turns"
    remedy: ClassVar[str] = (
        "check the steering linkages for a common rod or a twisting frame; measure the axle distances from "
        "the marker centroid again, because a wrong distance looks alike"
    )
    needs_steered_axles: ClassVar[bool] = True

    front_from_rear: float = parameter(unit="–", low=-0.5, high=0.5, scale=0.05)
    rear_from_front: float = parameter(unit="–", low=-0.5, high=0.5, scale=0.05)

    @staticmethod
    def steer(state: Floats, front_from_rear: float, rear_from_front: float) -> None:
        """Add to each angle a share of the other, both before coupling."""
        front, rear = state[FRONT], state[REAR]
        state[FRONT] = front + front_from_rear * rear
        state[REAR] = rear + rear_from_front * front
