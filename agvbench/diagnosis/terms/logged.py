"""Discrepancy terms of quantities that depend on a column that the lab logged, such as a voltage or a temperature.

Each is linear in the standardised column, by run or window: its size is that of one standard deviation. The number of
the column is a parameter that a regression or a linearisation chooses, and that a fit leaves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from agvbench.diagnosis.terms.base import DiscrepancyTerm
from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import FRONT, FRONT_SPEED, LOGGED, LOGGED_COUNT, REAR, REAR_SPEED
from agvbench.model.compiled import compiled
from agvbench.types import Floats


@compiled(inline=True)
def logged(state: Floats, column: float) -> float:
    """Return the standardised value of a column; a number beyond the last column means the last one."""
    value: float = state[LOGGED + min(max(int(column + 0.5), 0), LOGGED_COUNT - 1)]
    return value


def _column() -> Any:
    return parameter(unit="–", low=0.0, high=LOGGED_COUNT - 1.0, scale=1.0, is_discrete=True)


@dataclass(frozen=True)
class ByLoggedColumn(DiscrepancyTerm):
    """A term that depends on a logged column; the diagnosis reports the name of the column as covariate."""

    covariates: ClassVar[tuple[str, ...]] = ("logged_column",)


@dataclass(frozen=True)
class SpeedByLoggedColumn(ByLoggedColumn):
    """The speed depends on the column: ``v ← v (1 + change · z)``."""

    name: ClassVar[str] = "speed_by_logged_column"
    stage: ClassVar[Stage] = Stage.WHEELS
    through: ClassVar[str] = "speed"

    change: float = parameter(unit="–", low=-0.5, high=0.5, scale=0.05)
    column: float = _column()

    @staticmethod
    def drive(state: Floats, change: float, column: float) -> None:
        """Scale both axle speeds."""
        if change != 0.0:
            factor = 1.0 + change * logged(state, column)
            state[FRONT_SPEED] *= factor
            state[REAR_SPEED] *= factor


@dataclass(frozen=True)
class SteeringByLoggedColumn(ByLoggedColumn):
    """The steering gain of both axles depends on the column: ``δ ← δ (1 + gain · z)``."""

    name: ClassVar[str] = "steering_by_logged_column"
    stage: ClassVar[Stage] = Stage.WHEELS
    through: ClassVar[str] = "steering"

    gain: float = parameter(unit="–", low=-0.5, high=0.5, scale=0.05)
    column: float = _column()

    @staticmethod
    def steer(state: Floats, gain: float, column: float) -> None:
        """Scale both angles."""
        if gain != 0.0:
            factor = 1.0 + gain * logged(state, column)
            state[FRONT] *= factor
            state[REAR] *= factor


@dataclass(frozen=True)
class TrimByLoggedColumn(ByLoggedColumn):
    """The offset of the axle angles depends on the column: ``δ ← δ + angle · z``."""

    name: ClassVar[str] = "trim_by_logged_column"
    stage: ClassVar[Stage] = Stage.WHEELS
    through: ClassVar[str] = "steering"

    front_rad: float = parameter(unit="rad", low=-0.5, high=0.5, scale=0.02)
    rear_rad: float = parameter(unit="rad", low=-0.5, high=0.5, scale=0.02)
    column: float = _column()

    @staticmethod
    def steer(state: Floats, front_rad: float, rear_rad: float, column: float) -> None:
        """Turn both axles."""
        if front_rad != 0.0 or rear_rad != 0.0:
            z = logged(state, column)
            state[FRONT] += front_rad * z
            state[REAR] += rear_rad * z
