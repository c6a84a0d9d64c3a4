"""``silent``: no frame comes any more."""

from __future__ import annotations

from agvbench.adapters.impairment.faults import FrameFault
from agvbench.types import Frames


class Silent(FrameFault):
    """The stream has stopped: cameras were switched off, or their cable pulled."""

    name = "silent"

    def change(self, frames: Frames) -> Frames:
        """Give nothing."""
        return Frames.empty()
