"""A wheelbase that differs from the vehicle file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import FORWARD, LEFT, TAN_FRONT, TAN_REAR, YAW_RATE
from agvbench.types import Floats


@dataclass(frozen=True)
class WheelbaseError(Effect):
    """The wheelbase is longer than in the vehicle file by a share; each axle is half of that farther away.

    ``ψ̇ ← ψ̇ / (1 + longer)``, and the vehicle moves laterally as a body with these axles does.
    """

    name: ClassVar[str] = "wheelbase_error"
    stage: ClassVar[Stage] = Stage.BODY
    relaxes: ClassVar[str] = "the distances of the axles are exact (table 5.1)"
    reference: ClassVar[str] = "Bentvelsen 2015, eq. 5.7 and 5.8 with other distances of the axles"
    limits: ClassVar[str] = (
        "axle_coupling of both axles turns the vehicle in the same way, and mocap_scale nearly: measure the wheelbase"
    )
    remedy: ClassVar[str] = "measure the distance between the axles, and correct it in campaign.toml"
    needs_steered_axles: ClassVar[bool] = True

    longer: float = parameter(unit="–", low=-0.3, high=0.3, scale=0.02)

    @staticmethod
    def move(state: Floats, longer: float) -> None:
        """Turn and move laterally as with the other wheelbase."""
        shift = 0.5 * longer * (state[TAN_FRONT] + state[TAN_REAR]) * state[FORWARD]
        state[LEFT] = (state[LEFT] + shift) / (1.0 + longer)
        state[YAW_RATE] /= 1.0 + longer
