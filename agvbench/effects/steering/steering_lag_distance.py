"""Tyres that reach a new angle over a distance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import SPEED_AIM, STEERING_LAG
from agvbench.effects.variants import Variant
from agvbench.types import Floats

_LEAST_MPS = 1e-3
_TYPICAL_MPS = 0.3


@dataclass(frozen=True)
class SteeringLagDistance(Variant):
    """Wheels reach a new angle over a distance, not over a time: ``dδ/ds = (δ_map − δ) / length_m``.

    s is the way driven: at rest wheels keep their angle. The speed is that of the command in force.
    """

    name: ClassVar[str] = "steering_lag_distance"
    variant_of: ClassVar[str] = "steering_lag"
    stage: ClassVar[Stage] = Stage.SERVO
    relaxes: ClassVar[str] = "axles rotate instantaneously (7.3)"
    reference: ClassVar[str] = "relaxation length of tyres (Pacejka 2012, Tire and vehicle dynamics, section 1.2.1)"
    limits: ClassVar[str] = "at one speed alone it predicts the same as steering_lag"
    needs_steered_axles: ClassVar[bool] = True

    length_m: float = parameter(unit="m", low=0.0, high=2.0, scale=0.05)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start with the way that the vehicle goes within the library's lag, at a typical speed and at half of it."""
        lag = max(fitted["time_constant_s"], 0.02)
        return [(lag * _TYPICAL_MPS,), (0.5 * lag * _TYPICAL_MPS,)]

    @staticmethod
    def aim(state: Floats, length_m: float) -> None:
        """Set the lag of the axles by the speed that is commanded."""
        state[STEERING_LAG] = max(state[STEERING_LAG], length_m / max(abs(state[SPEED_AIM]), _LEAST_MPS))
