"""Backlash of each axle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import FRONT_BACKLASH, REAR_BACKLASH
from agvbench.effects.variants import Variant
from agvbench.types import Floats


@dataclass(frozen=True)
class SteeringBacklashUneven(Variant):
    """Free play between servo and axle, of another width at either axle."""

    name: ClassVar[str] = "steering_backlash_uneven"
    variant_of: ClassVar[str] = "steering_backlash"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "parts are tight (3.2)"
    reference: ClassVar[str] = (
        "Tao and Kokotović 1996, Adaptive Control of Systems with Actuator and Sensor Nonlinearities (play)"
    )
    limits: ClassVar[str] = "the width of an axle is visible only where its commands reach an angle from both sides"
    equivalents: ClassVar[Mapping[str, Mapping[str, float]]] = {
        "steering_backlash.width_rad": {"front_width_rad": 0.5, "rear_width_rad": 0.5}
    }
    needs_steered_axles: ClassVar[bool] = True

    front_width_rad: float = parameter(unit="rad", low=0.0, high=0.5, scale=0.03)
    rear_width_rad: float = parameter(unit="rad", low=0.0, high=0.5, scale=0.03)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with the width of both axles."""
        return [(fitted["width_rad"], fitted["width_rad"])]

    @staticmethod
    def aim(state: Floats, front_width_rad: float, rear_width_rad: float) -> None:
        """Set the width of the backlash of each axle."""
        state[FRONT_BACKLASH] = max(state[FRONT_BACKLASH], front_width_rad)
        state[REAR_BACKLASH] = max(state[REAR_BACKLASH], rear_width_rad)
