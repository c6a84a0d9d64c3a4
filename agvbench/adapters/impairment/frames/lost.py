"""``lost=SHARE``: that share of the frames never arrives."""

from __future__ import annotations

from agvbench.adapters.impairment.faults import FrameFault
from agvbench.types import Frames


class Dropped(FrameFault):
    """Leaves frames out, each by chance."""

    name = "lost"
    default = 0.1

    def change(self, frames: Frames) -> Frames:
        """Keep the others."""
        return frames.select(self.rng.random(len(frames)) >= self.value)
