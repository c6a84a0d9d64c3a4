"""The vehicle is where it cannot be: bodies were swapped, or the camera was moved."""

from __future__ import annotations

import math

import numpy as np

from agvbench.campaign.attempts import POSE_JUMPED
from agvbench.running.supervision.rule import Rule, Slice
from agvbench.types import Floats


class JumpRule(Rule):
    """Stops on a pose far from where the vehicle was going."""

    _before: tuple[float, Floats] | None = None
    _velocity: Floats = np.zeros(2)

    def complaint(self, seen: Slice) -> tuple[str, str, str] | None:
        """Compare the median place with the one that the last two predict."""
        if not len(seen):
            return None
        t_s, place = seen.place
        before, self._before = self._before, (t_s, place)
        if before is None or t_s <= before[0]:
            return None
        since_s = t_s - before[0]
        off_m = math.dist(place, before[1] + self._velocity * since_s)
        self._velocity = (place - before[1]) / since_s
        if off_m <= self.limits.jump_m:
            return None
        return POSE_JUMPED, f"{off_m:.2f} m from where the vehicle was going", f"{self.limits.jump_m:g} m"
