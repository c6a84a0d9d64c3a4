"""``late=SECONDS``: frames arrive that much later than they should."""

from __future__ import annotations

import numpy as np

from agvbench.adapters.impairment.faults import FrameFault
from agvbench.types import Frames


class Late(FrameFault):
    """Holds frames back until later ones are captured: a network or a computer that cannot keep up."""

    name = "late"
    default = 0.1
    highest = 60.0

    def begin(self, rng: np.random.Generator) -> None:
        """Forget what was held back."""
        super().begin(rng)
        self._held = Frames.empty()

    def change(self, frames: Frames) -> Frames:
        """Give what is old enough."""
        waiting = Frames.concatenate([self._held, frames])
        if not len(waiting):
            return waiting
        due = waiting.t_s <= np.max(waiting.t_s) - self.value
        self._held = waiting.select(~due)
        return waiting.select(due)
