"""An operator puts a real vehicle at the start of each run."""

from __future__ import annotations

from agvbench.running.placers.placer import Placer
from agvbench.running.placing import wait_for_start
from agvbench.types import Pose


class Operator(Placer):
    """Says how far off the vehicle is until it stands at the start."""

    places_simulated, places_real = False, True

    def place(self, start: Pose, run_id: str) -> None:
        """Wait."""
        wait_for_start(self._rig.link, self._neutral, start, limits=self._rig.limits, tell=self._rig.tell)
