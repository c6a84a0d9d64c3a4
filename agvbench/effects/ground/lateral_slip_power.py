"""Lateral slip by a power of the speed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import FORWARD, LEFT, YAW_RATE
from agvbench.effects.variants import Variant
from agvbench.types import Floats

_TYPICAL_MPS = 0.3


@dataclass(frozen=True)
class LateralSlipPower(Variant):
    """Curvature falls with a power of the speed: ``κ ← κ / (1 + loss (v / 0.3 m/s)ᵖ)``; the library has p = 2."""

    name: ClassVar[str] = "lateral_slip_power"
    variant_of: ClassVar[str] = "lateral_slip"
    stage: ClassVar[Stage] = Stage.BODY
    relaxes: ClassVar[str] = "slip is negligible (3.2)"
    reference: ClassVar[str] = "Gillespie 1992, ch. 6, for p = 2; the power is agvbench's own"
    limits: ClassVar[str] = "several speeds are needed: at one speed it is a scale of the steering"
    equivalents: ClassVar[Mapping[str, Mapping[str, float]]] = {
        "lateral_slip.gradient": {"loss": 1.0 / _TYPICAL_MPS**2}
    }

    loss: float = parameter(unit="–", low=-0.3, high=3.0, scale=0.1)
    exponent: float = parameter(unit="–", low=0.2, high=4.0, scale=1.0, null=2.0)

    @classmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Start near the library's exponent, and with an exponent of 1."""
        loss = fitted["gradient"] * _TYPICAL_MPS**2
        return [(loss, 1.8), (loss, 1.0)]

    @staticmethod
    def move(state: Floats, loss: float, exponent: float) -> None:
        """Reduce the yaw rate with a power of the speed."""
        if loss != 0.0:
            square = state[FORWARD] * state[FORWARD] + state[LEFT] * state[LEFT]
            state[YAW_RATE] /= 1.0 + loss * (square / (_TYPICAL_MPS * _TYPICAL_MPS)) ** (0.5 * exponent)
