"""``doubled=SHARE``: that share of the frames arrives twice."""

from __future__ import annotations

import numpy as np

from agvbench.adapters.impairment.faults import FrameFault
from agvbench.types import Frames


class Duplicate(FrameFault):
    """Says frames twice, each by chance."""

    name = "doubled"
    default = 0.1

    def change(self, frames: Frames) -> Frames:
        """Repeat them at once."""
        return frames.select(np.repeat(np.arange(len(frames)), 1 + (self.rng.random(len(frames)) < self.value)))
