"""What a rule is given, and what it answers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from agvbench.planning import Workspace
from agvbench.running.supervision.limits import SafetyLimits
from agvbench.types import Floats, Frames

_FEWEST_FRAMES = 3
"""A single wrong frame moves the median of fewer."""


class WatchWindow:
    """The tracked frames that rules judge by: those of a slice and, where they are fewer than three, the last before.

    A slice of which only a late or wrong frame is tracked is thus judged by two right ones, too.
    """

    def __init__(self) -> None:
        self._last = Frames.empty()

    def with_slice(self, frames: Frames) -> Frames:
        """Return what to judge by once `frames` arrived: nothing if none is tracked, or fewer than three ever were."""
        tracked = frames.select(frames.tracked)
        if not len(tracked):
            return tracked
        if len(tracked) < _FEWEST_FRAMES:
            tracked = _last_of(Frames.concatenate([self._last, tracked]))
        self._last = _last_of(tracked)
        return tracked if len(tracked) >= _FEWEST_FRAMES else Frames.empty()


def _last_of(frames: Frames) -> Frames:
    return frames.select(np.arange(max(0, len(frames) - _FEWEST_FRAMES), len(frames)))


@dataclass(frozen=True)
class Slice:
    """What was seen recently: times (n,) [s] and poses (n, 3) [m, m, rad] of the tracked frames, in order of capture.

    ``now_s`` [s] is when the slice should have ended in the run's clock, ``driving_s`` [s] for how long the vehicle has
    been commanded to drive, ``ahead_s`` [s] by how much the middle frame was captured later than it arrived.
    """

    t_s: Floats
    poses: Floats
    now_s: float
    driving_s: float
    ahead_s: float = 0.0

    @classmethod
    def of(cls, frames: Frames, now_s: float, driving_s: float) -> Slice:
        """Return what is tracked of `frames`."""
        order = np.argsort(frames.t_s, kind="stable")
        order = order[frames.tracked[order]]
        poses = np.column_stack([frames.x_m[order], frames.y_m[order], frames.heading_rad[order]])
        ahead = (frames.t_s - frames.received_s)[order]
        known = ahead[np.isfinite(ahead)]
        return cls(frames.t_s[order], poses, now_s, driving_s, float(middle(known)) if len(known) else 0.0)

    def __len__(self) -> int:
        return len(self.t_s)

    @cached_property
    def place(self) -> tuple[float, Floats]:
        """The middle time [s] and place (2,) [m]: medians, which single wrong frames do not move."""
        t_s, *place = middle(np.column_stack([self.t_s, self.poses[:, :2]])).tolist()
        return t_s, np.array(place)


def middle(values: Floats) -> Floats:
    """Return the medians of columns; numpy's own takes ten times as long for a dozen rows, ten times a second."""
    ordered = np.sort(values, axis=0)
    return np.asarray(0.5 * (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2]))


class Rule(ABC):
    """Watches one run; made anew for each."""

    ends_session: ClassVar[bool] = True
    """Whether a person has to look at vehicle or camera after a stop, before anything is driven again."""

    def __init__(self, limits: SafetyLimits, workspace: Workspace) -> None:
        self.limits, self.workspace = limits, workspace

    @abstractmethod
    def complaint(self, seen: Slice) -> tuple[str, str, str] | None:
        """Return what is wrong, the value and the limit; None if nothing is."""
