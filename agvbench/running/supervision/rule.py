"""What a rule is given, and what it answers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from agvbench.planning import Workspace
from agvbench.running.supervision.limits import SafetyLimits
from agvbench.types import Floats, Frames


@dataclass(frozen=True)
class Slice:
    """What was seen lately: times (n,) [s] and poses (n, 3) [m, m, rad] of the tracked frames, in order of capture.

    ``now_s`` [s] is the run's clock, ``driving_s`` [s] for how long the vehicle has been told to drive.
    """

    t_s: Floats
    poses: Floats
    now_s: float
    driving_s: float

    @classmethod
    def of(cls, frames: Frames, now_s: float, driving_s: float) -> Slice:
        """Return what is tracked of `frames`."""
        order = np.argsort(frames.t_s, kind="stable")
        order = order[frames.tracked[order]]
        poses = np.column_stack([frames.x_m[order], frames.y_m[order], frames.heading_rad[order]])
        return cls(frames.t_s[order], poses, now_s, driving_s)

    def __len__(self) -> int:
        return len(self.t_s)

    @cached_property
    def place(self) -> tuple[float, Floats]:
        """The middle time [s] and place (2,) [m]: medians, which single wrong frames do not move."""
        return float(np.median(self.t_s)), np.median(self.poses[:, :2], axis=0)


class Rule(ABC):
    """Watches one run; made anew for each."""

    def __init__(self, limits: SafetyLimits, workspace: Workspace) -> None:
        self.limits, self.workspace = limits, workspace

    @abstractmethod
    def complaint(self, seen: Slice) -> tuple[str, str, str] | None:
        """Return what is wrong, the value and the limit; None if nothing is."""
