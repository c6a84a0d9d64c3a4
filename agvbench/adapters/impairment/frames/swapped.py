"""``swapped=METRES``: the pose is that of another rigid body, so far to the left on the floor."""

from __future__ import annotations

from dataclasses import replace

from agvbench.adapters.impairment.faults import FrameFault
from agvbench.types import Frames


class Swapped(FrameFault):
    """Two bodies were taken for each other."""

    name = "swapped"
    default = 0.8
    lowest, highest = -10.0, 10.0

    def change(self, frames: Frames) -> Frames:
        """Show the other body, which moves as the vehicle does: the worst case."""
        return replace(frames, y_m=frames.y_m + self.value)
