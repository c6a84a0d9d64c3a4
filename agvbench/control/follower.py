"""Progress along a plan's path: which section is driven, how far along it the vehicle is, how fast, and the end."""

from __future__ import annotations

import math
from dataclasses import dataclass

from agvbench.control.controller import ControlInput
from agvbench.control.reference import Reference
from agvbench.control.sections import PathSection, sections_of
from agvbench.errors import FlagError
from agvbench.types import Pose

_SEARCH_M = 0.05


@dataclass(frozen=True)
class Tracking:
    """Where the vehicle is on its path.

    Parameters
    ----------
    section
        What is driven.
    s_m
        Arc length of the nearest point of its path [m].
    guide
        The guide point in the start frame [m], and the direction in which the vehicle faces its motion [rad].
    speed_mps
        Speed to drive at [m/s], negative backward; 0 while the plan rests.
    """

    section: PathSection
    s_m: float
    guide: Pose
    speed_mps: float


@dataclass(frozen=True)
class Approach:
    """How the vehicle comes to the end of a section.

    Parameters
    ----------
    slow_m
        Over this distance [m] before the end the speed falls in proportion to what is left of it; 0 keeps the speed.
    least_share
        But not below this share of the planned speed, at which the drive still moves the vehicle.
    coast_s
        The drive stops this long [s] times the speed before the end: so far the vehicle coasts. The default is half the
        time that the thesis' vehicle takes to come to rest (section 8.1).

    Raises
    ------
    FlagError
        If a distance or time is negative or not finite, or the share is not in (0, 1].
    """

    slow_m: float = 0.3
    least_share: float = 0.4
    coast_s: float = 0.3

    def __post_init__(self) -> None:
        for name in ("slow_m", "coast_s"):
            require(0.0 <= getattr(self, name) < math.inf, name, getattr(self, name), "from 0")
        require(0.0 < self.least_share <= 1.0, "least_share", self.least_share, "above 0, at most 1")

    def share(self, left_m: float) -> float:
        """Return the share of the planned speed with `left_m` [m] to go."""
        return 1.0 if left_m >= self.slow_m else max(self.least_share, left_m / self.slow_m)


def require(condition: bool, name: str, value: float, limit: str) -> None:
    """Raise `FlagError` about a parameter of a controller unless `condition` holds."""
    if not condition:
        raise FlagError("value cannot be used", where=f"parameter {name} of the controller", value=value, limit=limit)


class PathFollower:
    """Follows the sections of a plan one after another, with the rests that the plan has before them.

    Progress is searched near the last one, so that a path may cross itself. The state is that of one run.
    """

    def __init__(self, reference: Reference, approach: Approach, lever_m: float = 0.0) -> None:
        self._left = sections_of(reference, lever_m)
        self._approach = approach
        self._since_s, self._before_s, self._s_m = 0.0, 0.0, 0.0

    def step(self, seen: ControlInput) -> Tracking | None:
        """Return where the vehicle is; None at the end of the last section."""
        while self._left:
            tracking = self._tracking(seen)
            if tracking is not None:
                self._before_s = seen.t_s
                return tracking
            self._left.pop(0)
            self._since_s, self._s_m = seen.t_s, 0.0
        return None

    def _tracking(self, seen: ControlInput) -> Tracking | None:
        """Return where the vehicle is on the first section; None at its end."""
        section = self._left[0]
        guide = section.guide(seen.pose)
        speed = section.speed_at(self._s_m)
        within_m = _SEARCH_M + 2.0 * abs(speed) * (seen.t_s - self._before_s)
        self._s_m = section.progress(guide, self._s_m, within_m)
        if seen.t_s < self._since_s + section.rest_s - 1e-9:
            return Tracking(section, self._s_m, guide, 0.0)
        left_m = section.length_m - self._s_m
        speed = section.speed_at(self._s_m) * self._approach.share(left_m)
        if left_m <= abs(speed) * (self._approach.coast_s + seen.age_s):
            return None
        return Tracking(section, self._s_m, guide, speed)
