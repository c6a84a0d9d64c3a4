"""The vehicle is about to leave the capture volume."""

from __future__ import annotations

import numpy as np

from agvbench.campaign.attempts import LEAVES_WORKSPACE
from agvbench.running.supervision.rule import Rule, Slice
from agvbench.types import Floats


class VolumeRule(Rule):
    """Stops a vehicle that could not come to rest inside any more."""

    ends_session = False

    _before: tuple[float, Floats] | None = None

    def complaint(self, seen: Slice) -> tuple[str, str, str] | None:
        """Add the stopping distance to the place, in the direction of motion."""
        if not len(seen):
            return None
        t_s, place = seen.place
        before, self._before = self._before, (t_s, place)
        velocity = np.zeros(2)
        if before is not None and t_s > before[0]:
            velocity = (place - before[1]) / (t_s - before[0])
        # Until the stop arrives the vehicle drives on; then it brakes, at half its speed on average.
        ahead_s = seen.now_s - t_s + self.limits.watch_s + 0.5 * self.limits.braking_s
        rest = place + velocity * ahead_s
        clearance_m = float(self.workspace.clearances(rest[None])[0])
        if clearance_m >= 0.0:
            return None
        at = f"{-clearance_m:.2f} m outside {self.workspace.name}, from {np.hypot(*velocity):.2f} m/s"
        return LEAVES_WORKSPACE, f"would come to rest {at}", "0 m"
