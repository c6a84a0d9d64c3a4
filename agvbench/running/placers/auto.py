"""The vehicle drives itself to the start of each run, so that repeats need nobody."""

from __future__ import annotations

from agvbench.errors import PlacingError, RunStoppedError
from agvbench.running.placers.operator import Operator
from agvbench.running.placers.placer import Placer, Rig
from agvbench.running.placing import wait_until_seen
from agvbench.running.returning.placing import Placing
from agvbench.running.returning.returner import Returner
from agvbench.types import Pose

_MOST_STOPS = 3
"""On the way to one start, before the last attempt."""


class Auto(Placer):
    """Drives back; where a real vehicle does not come to its start, an operator is asked.

    A simulated vehicle is put at the first start of a session, since it stands nowhere before, and at the next start
    after the supervisor stopped it.
    """

    places_simulated, places_real = True, True

    def __init__(self, rig: Rig) -> None:
        super().__init__(rig)
        self._returner = Returner(rig.link, rig.model, rig.workspace, rig.supervisor)
        self._is_simulated = rig.link.identity().simulated
        self._stands = not self._is_simulated

    def place(self, start: Pose, run_id: str) -> Placing | None:
        """Drive to `start`."""
        try:
            return self._drive_to(start, run_id)
        except (PlacingError, RunStoppedError) as error:
            if self._is_simulated:
                raise
            self._rig.tell(str(error))
        Operator(self._rig).place(start, run_id)
        return None

    def _drive_to(self, start: Pose, run_id: str) -> Placing:
        """Drive to `start`; after a stop that does not end the session, try again as soon as the vehicle is seen."""
        for _ in range(_MOST_STOPS):
            try:
                return self._returned(start, run_id)
            except RunStoppedError:
                self.was_moved()
                if not self._is_simulated:
                    wait_until_seen(self._rig.link, self._neutral, tell=self._rig.tell)
        return self._returned(start, run_id)

    def _returned(self, start: Pose, run_id: str) -> Placing:
        if not self._stands:
            self._rig.link.reset(start, run_key=run_id)
            self._stands = True
        return self._returner.bring_to(start)

    def was_moved(self) -> None:
        """Reset the vehicle before the next run."""
        self._stands = not self._is_simulated
