"""``guessed``: frames say that the vehicle is not tracked, and show a plausible pose all the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agvbench.adapters.impairment.faults import FrameFault
from agvbench.types import Frames


class Extrapolated(FrameFault):
    """Motion capture software that extrapolates: the pose looks as good as ever, but it was not measured."""

    name = "guessed"

    def change(self, frames: Frames) -> Frames:
        """Keep the poses, and admit that they are guesses."""
        return replace(frames, tracked=np.zeros(len(frames), np.bool_))
