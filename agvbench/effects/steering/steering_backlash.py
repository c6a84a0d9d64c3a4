"""Backlash between servo and axle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import FRONT_BACKLASH, REAR_BACKLASH
from agvbench.types import Floats


@dataclass(frozen=True)
class SteeringBacklash(Effect):
    """Free play between servo and axle: δ rests until its servo is half a width away, then follows at that distance.

    The position of an axle depends on its previous positions. A run begins with both axles in the middle of the gap.
    """

    name: ClassVar[str] = "steering_backlash"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "parts are tight (3.2)"
    reference: ClassVar[str] = (
        "Tao and Kokotović 1996, Adaptive Control of Systems with Actuator and Sensor Nonlinearities (play)"
    )
    limits: ClassVar[str] = (
        "visible only where a command is reached from both sides; otherwise it is an offset, which a static map absorbs"
    )
    remedy: ClassVar[str] = (
        "tighten or replace the joints of the steering linkage; until then approach each angle from the same side"
    )
    needs_steered_axles: ClassVar[bool] = True

    width_rad: float = parameter(unit="rad", low=0.0, high=0.5, scale=0.03)

    @staticmethod
    def beside(outputs: Floats, at_neutral: float, *parameters: float) -> Floats:
        """Return the map of a servo whose axle lags by half the backlash on its way from neutral."""
        (width_rad,) = parameters
        return np.asarray(outputs + 0.5 * width_rad * np.sign(outputs - at_neutral))

    @staticmethod
    def aim(state: Floats, width_rad: float) -> None:
        """Set the width of the backlash of both axles."""
        state[FRONT_BACKLASH] = width_rad
        state[REAR_BACKLASH] = width_rad
