"""Single measurements of an axle or of the drive, from which its curve is fitted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from agvbench.calibration.points import CurvePoints

Role = Literal["front", "rear", "drive"]
ROLES: tuple[Role, ...] = ("front", "rear", "drive")


@dataclass(frozen=True)
class Sample:
    """One measured value of one role: rad for an axle, m/s (along the wheels) for the drive.

    ``why_left_out`` is empty for a sample that counts.
    """

    role: Role
    command: float
    value: float
    stderr: float
    run_id: str
    why_left_out: str = ""

    def without(self, why: str) -> Sample:
        """Return this sample, left out because of `why`."""
        return replace(self, why_left_out=why)


def points_of(samples: list[Sample], role: Role) -> CurvePoints:
    """Return one point per command from the samples of `role` that count."""
    counted = [s for s in samples if s.role == role and not s.why_left_out]
    return CurvePoints.from_measurements(np.array([s.command for s in counted]), np.array([s.value for s in counted]))
