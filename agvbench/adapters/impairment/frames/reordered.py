"""``reordered=SHARE``: that share of the frames arrives after the next."""

from __future__ import annotations

import numpy as np

from agvbench.adapters.impairment.faults import FrameFault
from agvbench.types import Frames


class Reordered(FrameFault):
    """Swaps neighbours, each pair by chance."""

    name = "reordered"
    default = 0.1

    def change(self, frames: Frames) -> Frames:
        """Swap frames with the next."""
        order = np.arange(len(frames))
        for index in np.flatnonzero(self.rng.random(max(0, len(frames) - 1)) < self.value):
            order[[index, index + 1]] = order[[index + 1, index]]
        return frames.select(order)
