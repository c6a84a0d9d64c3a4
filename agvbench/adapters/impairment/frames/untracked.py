"""``untracked``: frames come, and the vehicle is in none of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agvbench.adapters.impairment.faults import FrameFault
from agvbench.types import Frames


class Untracked(FrameFault):
    """Markers are hidden, or the body is not known to the cameras any more."""

    name = "untracked"

    def change(self, frames: Frames) -> Frames:
        """Blank the poses."""
        nowhere = np.full(len(frames), np.nan)
        tracked = np.zeros(len(frames), np.bool_)
        return replace(frames, x_m=nowhere, y_m=nowhere, heading_rad=nowhere, tracked=tracked)
