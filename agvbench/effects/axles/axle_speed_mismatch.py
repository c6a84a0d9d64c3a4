"""Different speeds of front and rear wheels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import REAR_SPEED
from agvbench.types import Floats


@dataclass(frozen=True)
class AxleSpeedMismatch(Effect):
    """The driven axles have different speeds: ``v_r = (1 + ratio) v_f`` in equation 5.6."""

    name: ClassVar[str] = "axle_speed_mismatch"
    stage: ClassVar[Stage] = Stage.WHEELS
    relaxes: ClassVar[str] = "the front axle's speed equals the rear's (9.2)"
    reference: ClassVar[str] = "Bentvelsen 2015, equation 5.6 and section 9.2"
    limits: ClassVar[str] = (
        "with equal angles of both axles it is a scale of speed, which the drive's map absorbs; 5 % changes little"
    )
    remedy: ClassVar[str] = "match the speeds of both axles: wheel diameters, gears, settings of the motor controllers"
    needs_both_axles_driven: ClassVar[bool] = True
    needs_steered_axles: ClassVar[bool] = True

    ratio: float = parameter(unit="–", low=-0.5, high=0.5, scale=0.05)

    @staticmethod
    def drive(state: Floats, ratio: float) -> None:
        """Scale the speed of the rear axle."""
        state[REAR_SPEED] *= 1.0 + ratio
