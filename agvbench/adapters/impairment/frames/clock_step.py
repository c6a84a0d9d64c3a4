"""``clock_step=SECONDS``: the camera's clock is set, forward or back."""

from __future__ import annotations

from dataclasses import replace

from agvbench.adapters.impairment.faults import FrameFault
from agvbench.types import Frames


class ClockStep(FrameFault):
    """Capture times jump; the poses are right."""

    name = "clock_step"
    default = 1.0
    lowest, highest = -3600.0, 3600.0

    def change(self, frames: Frames) -> Frames:
        """Say another time."""
        return replace(frames, t_s=frames.t_s + self.value)
