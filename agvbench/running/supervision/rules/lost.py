"""The vehicle has not been seen for a while."""

from __future__ import annotations

import math

from agvbench.running.supervision.rule import Rule, Slice


class LostRule(Rule):
    """Stops on tracking that is lost, and on a camera that has fallen silent."""

    ends_session = False

    _last_s = math.nan

    def complaint(self, seen: Slice) -> tuple[str, str, str] | None:
        """Compare the last tracked frame with the clock."""
        if len(seen):
            self._last_s = float(seen.t_s[-1])
        elif math.isnan(self._last_s):
            self._last_s = seen.now_s  # nothing was ever seen: give it as long as anybody
        unseen_s = seen.now_s - self._last_s
        if unseen_s <= self.limits.lost_s:
            return None
        return "tracking was lost", f"not seen for {unseen_s:.2f} s", f"{self.limits.lost_s:g} s"
