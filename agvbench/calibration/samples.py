"""Measured samples of an axle or of the drive, and the points of their curve: the median of a command's repeats."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agvbench.errors import FitError
from agvbench.types import Floats
from agvbench.vehicle.channels import Role

# Smaller values, whose squares underflow, are zero: no fit divides by them or takes their logarithm.
_ZERO = 1e-100


@dataclass(frozen=True)
class CurvePoints:
    """One point per command, by ascending command: arrays of shape (k,).

    ``value`` is the median of the repeats (as in tables 7.1–7.4), ``stderr`` its standard error from their dispersion
    (NaN for a single measurement), ``repeats`` how many there are.
    """

    command: Floats
    value: Floats
    stderr: Floats
    repeats: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.command)

    def select(self, mask: NDArray[np.bool_]) -> CurvePoints:
        """Return the points that `mask` chooses."""
        return CurvePoints(self.command[mask], self.value[mask], self.stderr[mask], self.repeats[mask])

    @classmethod
    def from_measurements(cls, command: ArrayLike, value: ArrayLike) -> CurvePoints:
        """Return the points of single measurements; those that are not finite are left aside.

        Raises
        ------
        FitError
            If `command` and `value` are not two lists of equally many numbers.
        """
        x, y = np.asarray(command, dtype=np.float64), np.asarray(value, dtype=np.float64)
        if x.ndim != 1 or x.shape != y.shape:
            raise FitError("commands and values must be two lists of equal length", value=f"{x.shape} and {y.shape}")
        y = np.where(np.abs(y) < _ZERO, 0.0, y)
        known = np.isfinite(x) & np.isfinite(y)
        commands, group = np.unique(x[known], return_inverse=True)
        repeats = [y[known][group == k] for k in range(len(commands))]
        return cls(
            commands,
            np.array([float(np.median(r)) for r in repeats]),
            np.array([1.2533 * float(np.std(r, ddof=1)) / len(r) ** 0.5 if len(r) > 1 else np.nan for r in repeats]),
            np.array([len(r) for r in repeats], dtype=np.int64),
        )


@dataclass(frozen=True)
class Sample:
    """One measured value of one role: rad for an axle, rad/s for a yaw rate, m/s (along the wheels) for the drive.

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
