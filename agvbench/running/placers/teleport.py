"""A simulated vehicle is put at the start of each run by software."""

from __future__ import annotations

from agvbench.running.placers.placer import Placer
from agvbench.types import Pose


class Teleport(Placer):
    """Leaves it to the run, which resets the vehicle: all randomness of a run then follows from its key."""

    places_simulated, places_real = True, False

    def place(self, start: Pose, run_id: str) -> None:
        """Do nothing."""

    def run_key(self, run_id: str) -> str:
        """Return the run's own key."""
        return run_id
