"""Decrease of the speed with battery discharge."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import FRONT_SPEED, HOURS, REAR_SPEED
from agvbench.types import Floats


@dataclass(frozen=True)
class BatteryDroop(Effect):
    """Speed falls with the time in use: ``v ← v (1 − per_hour · hours since the session began)``."""

    name: ClassVar[str] = "battery_droop"
    stage: ClassVar[Stage] = Stage.WHEELS
    relaxes: ClassVar[str] = "the battery is negligible (9.2)"
    reference: ClassVar[str] = "Bentvelsen 2015, section 8.2 (endurance)"
    limits: ClassVar[str] = (
        "linear in time: neither the steep end of a discharge nor a battery that recovers in a pause; a speed that "
        "grows with use is no battery (speed_by_campaign_time)"
    )
    remedy: ClassVar[str] = (
        "control the speed of the wheels instead of the voltage, or charge between runs; record the battery "
        "voltage of each run"
    )

    per_hour: float = parameter(unit="1/h", low=0.0, high=2.0, scale=0.1)

    @staticmethod
    def drive(state: Floats, per_hour: float) -> None:
        """Scale both axle speeds by time."""
        factor = 1.0 - per_hour * state[HOURS]
        state[FRONT_SPEED] *= factor
        state[REAR_SPEED] *= factor
