"""Dead band of the drive about neutral."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import DRIVE_COMMAND, SPEED_AIM
from agvbench.types import Floats


@dataclass(frozen=True)
class DriveDeadBand(Effect):
    """No motion within ± width of neutral, less beyond: ``v ← v (1 − width / |c|)``, c the command's distance from it.

    For a linear map that is the usual dead zone, v = k (c ∓ width); it is continuous, so that a fit can find the width.
    """

    name: ClassVar[str] = "drive_dead_band"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "a cubic describes the drive (7.4)"
    reference: ClassVar[str] = "Bentvelsen 2015, table 7.4; Tao and Kokotović 1996 (dead zone)"
    limits: ClassVar[str] = "a static map with a dead band contains it: use it only beside a map without one"
    remedy: ClassVar[str] = "calibrate the dead band of the motor controller, or avoid commands within it"

    width: float = parameter(unit="command", low=0.0, high=500.0, scale=1.0)

    @staticmethod
    def aim(state: Floats, width: float) -> None:
        """Subtract the dead band from the speed aim."""
        if width > 0.0:
            distance = abs(state[DRIVE_COMMAND])
            state[SPEED_AIM] *= 1.0 - width / distance if distance > width else 0.0
