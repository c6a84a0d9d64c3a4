"""The vehicle drives itself to the start of each run, so that repeats need nobody."""

from __future__ import annotations

from agvbench.errors import PlacingError
from agvbench.running.placers.operator import Operator
from agvbench.running.placers.placer import Placer, Rig
from agvbench.running.placing import say
from agvbench.running.returning.placing import Placing
from agvbench.running.returning.returner import Returner
from agvbench.types import Pose


class Auto(Placer):
    """Drives back; where a real vehicle does not come to its start, an operator is asked.

    A simulated vehicle is put at the first start of a session, since it stands nowhere before.
    """

    places_simulated, places_real = True, True

    def __init__(self, rig: Rig) -> None:
        super().__init__(rig)
        self._returner = Returner(rig.link, rig.model, rig.workspace, rig.supervisor)
        self._is_simulated = rig.link.identity().simulated
        self._stands = not self._is_simulated

    def place(self, start: Pose, run_id: str) -> Placing | None:
        """Drive to `start`."""
        if not self._stands:
            self._rig.link.reset(start, run_key=run_id)
            self._stands = True
        try:
            return self._returner.bring_to(start)
        except PlacingError as error:
            if self._is_simulated:
                raise
            say(str(error))
        Operator(self._rig).place(start, run_id)
        return None

    def was_moved(self) -> None:
        """Reset the vehicle before the next run."""
        self._stands = not self._is_simulated
