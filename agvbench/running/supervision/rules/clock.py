"""The camera's clock was set, or is not understood: past frames cannot be distinguished from future ones."""

from __future__ import annotations

import math

from agvbench.campaign.attempts import CAMERA_AHEAD, CAMERA_SET_BACK
from agvbench.running.supervision.rule import Rule, Slice


class ClockRule(Rule):
    """Stops on poses from the future, and on capture times that go back.

    A stepped clock makes old poses look new: every other rule would judge by them.
    """

    _before_s = math.nan

    def complaint(self, seen: Slice) -> tuple[str, str, str] | None:
        """Compare the median capture time with that of arrival, and with the one before.

        Arrival, not the slice's end: a runner that was held up looks late, at frames that came meanwhile.
        """
        if not len(seen):
            return None
        t_s, _ = seen.place
        before_s, self._before_s = self._before_s, t_s
        back_s = before_s - t_s
        limit = f"{self.limits.clock_s:g} s"
        if seen.ahead_s > self.limits.clock_s:
            return CAMERA_AHEAD, f"poses from {seen.ahead_s:.2f} s in the future", limit
        if back_s > self.limits.clock_s:
            return CAMERA_SET_BACK, f"poses {back_s:.2f} s older than those before", limit
        return None
