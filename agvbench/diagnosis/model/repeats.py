"""Derivatives of repeated runs: simulated for one of them, and turned to the initial heading of the others."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.readings import Readings
from agvbench.types import Floats

_SAME_TIME_S = 0.02
# Runs are predicted alike if their poses differ by less, relative to the distance from the start, and in heading [rad].
_SAME_SHARE, _SAME_HEADING = 0.02, 0.02


@dataclass(frozen=True)
class Repeats:
    """Which run represents each of R runs, whose derivatives are simulated.

    A vehicle drives repeats of equal commands alike but for its start pose and its random effects, so that a change of
    a parameter moves their poses by the same way in the frame of the start pose.

    ``representative`` (R,): index of the run whose changes are those of each run, up to a rotation; a run without a
    repeat represents itself.
    """

    representative: NDArray[np.int64]

    @classmethod
    def of(cls, readings: Readings) -> Repeats:
        """Return the repeats among `readings`: equal commands, given and sampled at equal times within 20 ms.

        Windows of free driving have none: their axles and speeds differ at the start.
        """
        representative = np.arange(len(readings))
        if readings.initial_states is not None:
            return cls(representative)
        first: dict[int, list[int]] = {}
        for i, group in enumerate(readings.group.tolist()):
            alike = first.setdefault(group, [])
            found = next((other for other in alike if _same_times(readings, i, other)), None)
            if found is None:
                alike.append(i)
            else:
                representative[i] = found
        return cls(representative)

    def among_alike(self, poses: Floats, heading: Floats) -> Repeats:
        """Return the repeats whose predicted `poses` (R, K, 3) are nearly the same in the frame of the start pose.

        `heading` (R,) is the initial heading. Random effects and campaign time may make repeats differ: such a run
        represents itself.
        """
        if not self.are_any:
            return self
        own = np.arange(len(heading))
        expected = self.turned(poses[self.representative] - poses[self.representative, :1], own, heading)
        apart = poses - poses[:, :1] - expected
        way = np.max(np.hypot(expected[..., 0], expected[..., 1]), axis=1)
        near = np.max(np.hypot(apart[..., 0], apart[..., 1]), axis=1) <= _SAME_SHARE * way
        turned = np.max(np.abs(apart[..., 2]), axis=1) <= _SAME_HEADING
        return Repeats(np.where(near & turned, self.representative, own))

    @cached_property
    def are_any(self) -> bool:
        """Whether a run represents another."""
        return bool(np.any(self.representative != np.arange(len(self.representative))))

    @cached_property
    def simulated(self) -> NDArray[np.int64]:
        """The indices of the runs that represent others or themselves, ascending."""
        return np.unique(self.representative)

    def turned(self, changes: Floats, runs: NDArray[np.int64], heading: Floats) -> Floats:
        """Return the changes (n, K, 3) of `runs` (n,) from those of their representatives, (n, K, 3).

        `heading` (R,) is the initial heading of every run.
        """
        angle = heading[runs] - heading[self.representative[runs]]
        cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
        x, y, turn = changes[..., 0], changes[..., 1], changes[..., 2]
        return np.stack([cosine * x - sine * y, sine * x + cosine * y, turn], axis=-1)


def _same_times(readings: Readings, run: int, other: int) -> bool:
    commands = readings.runs[run].commands.t_s - readings.runs[other].commands.t_s
    samples = readings.t_s[run] - readings.t_s[other]
    return bool(np.all(np.abs(commands) <= _SAME_TIME_S) and np.all(np.abs(samples) <= _SAME_TIME_S))
