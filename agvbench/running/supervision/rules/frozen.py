"""The vehicle should drive, and the camera says the very same pose again and again."""

from __future__ import annotations

import math

import numpy as np

from agvbench.campaign.attempts import CAMERA_FROZEN
from agvbench.running.supervision.rule import Rule, Slice


class FrozenRule(Rule):
    """Stops on a stream that repeats itself: a real camera is never quite still.

    A simulated camera without noise says the same pose of a vehicle that stands still; so this holds only for one that
    is known to flicker, or was seen to in this run.
    """

    _seen_to_flicker = False
    _pose: tuple[float, ...] = ()
    _since_s = math.nan

    def complaint(self, seen: Slice) -> tuple[str, str, str] | None:
        """Count how long the pose has not changed in its last bit."""
        if not len(seen):
            return None
        changed = (np.diff(seen.poses, axis=0) != 0.0).any(axis=1)
        last = tuple(seen.poses[-1].tolist())
        moved = bool(changed.any())
        if self._pose:
            moved = moved or last != self._pose
            self._seen_to_flicker = self._seen_to_flicker or moved
        if moved or not self._pose:
            after = int(np.flatnonzero(changed)[-1]) + 1 if changed.any() else 0
            self._since_s = float(seen.t_s[after])
        self._pose = last
        still_s = float(seen.t_s[-1]) - self._since_s
        flickers = self.limits.flickers or self._seen_to_flicker
        if not flickers or min(still_s, seen.driving_s) <= self.limits.frozen_s:
            return None
        return CAMERA_FROZEN, f"the same pose for {still_s:.2f} s", f"{self.limits.frozen_s:g} s"
