"""``frozen``: new frames, with the last pose again and again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agvbench.adapters.impairment.faults import FrameFault
from agvbench.types import Frames


class Frozen(FrameFault):
    """The stream goes on, and what it shows does not: software that hangs behind a server that does not."""

    name = "frozen"

    def begin(self, rng: np.random.Generator) -> None:
        """Forget the pose."""
        super().begin(rng)
        self._pose: tuple[float, float, float] | None = None

    def change(self, frames: Frames) -> Frames:
        """Show the first pose for ever."""
        seen = np.flatnonzero(frames.tracked)
        if self._pose is None and len(seen):
            first = int(seen[0])
            self._pose = float(frames.x_m[first]), float(frames.y_m[first]), float(frames.heading_rad[first])
        if self._pose is None:
            return frames
        x_m, y_m, heading_rad = (np.where(frames.tracked, value, np.nan) for value in self._pose)
        return replace(frames, x_m=x_m, y_m=y_m, heading_rad=heading_rad)
