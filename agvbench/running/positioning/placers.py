"""Placers: a vehicle comes to the start of a run by software, by an operator, or by driving there itself."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

from agvbench.errors import FlagError, OneOf, PlacingError, RunStoppedError
from agvbench.model import VehicleModel
from agvbench.planning import Workspace
from agvbench.running.links import RunnerLink
from agvbench.running.positioning.automatic_return.pose_returner import ReturnResult
from agvbench.running.positioning.automatic_return.returner import Returner
from agvbench.running.positioning.automatic_return.turn_and_drive import TurnAndDrive
from agvbench.running.positioning.start_pose import notify_operator, wait_for_start, wait_until_seen
from agvbench.running.quality import QualityLimits
from agvbench.running.supervision.supervisor import Supervisor
from agvbench.types import Command, Pose


@dataclass(frozen=True)
class Rig:
    """What vehicles are placed with: link, nominal model, supervision, workspace, and the progress callback."""

    link: RunnerLink
    model: VehicleModel
    workspace: Workspace
    supervisor: Supervisor
    limits: QualityLimits
    on_progress: Callable[[str], None] = notify_operator


class Placer(ABC):
    """Brings the vehicle to the start of each run; `PLACERS` says what ``--place`` calls it."""

    places_simulated: ClassVar[bool]
    places_real: ClassVar[bool]

    def __init__(self, rig: Rig) -> None:
        self._rig = rig

    @property
    def _neutral(self) -> Command:
        """The command at which the vehicle stands."""
        return self._rig.model.neutral

    @abstractmethod
    def place(self, start: Pose, run_id: str) -> ReturnResult | None:
        """Bring the vehicle to `start` (floor frame) for the run `run_id`; None if there is nothing to report of it.

        Raises
        ------
        PlacingError
            If it did not come there.
        LinkError
            If the bus or an adapter fails, or the supervisor stopped the vehicle for what ends the session.
        """

    def run_key(self, run_id: str) -> str | None:
        """Return what the run resets a simulated vehicle with; None leaves it where it stands."""
        return None

    def was_moved(self) -> None:  # noqa: B027  (most need not know)
        """Take note that a simulated vehicle was stopped, or drove a recorded run unseen: its pose is unknown."""


class Teleport(Placer):
    """Leaves it to the run, which resets the vehicle: all randomness of a run then follows from its key."""

    places_simulated, places_real = True, False

    def place(self, start: Pose, run_id: str) -> None:
        """Do nothing."""

    def run_key(self, run_id: str) -> str:
        """Return the run's own key."""
        return run_id


class Operator(Placer):
    """Says how far off the vehicle is until it stands at the start."""

    places_simulated, places_real = False, True

    def place(self, start: Pose, run_id: str) -> None:
        """Wait."""
        wait_for_start(self._rig.link, self._neutral, start, limits=self._rig.limits, on_progress=self._rig.on_progress)


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
        kind = TurnAndDrive if rig.model.geometry.is_differential else Returner
        self._returner = kind(rig.link, rig.model, rig.workspace, rig.supervisor)
        self._is_simulated = rig.link.identity().simulated
        self._stands = not self._is_simulated

    def place(self, start: Pose, run_id: str) -> ReturnResult | None:
        """Drive to `start`."""
        try:
            return self._drive_to(start, run_id)
        except (PlacingError, RunStoppedError) as error:
            if self._is_simulated:
                raise
            self._rig.on_progress(str(error))
        Operator(self._rig).place(start, run_id)
        return None

    def _drive_to(self, start: Pose, run_id: str) -> ReturnResult:
        """Drive to `start`; after a stop that does not end the session, try again as soon as the vehicle is seen."""
        for _ in range(_MOST_STOPS):
            try:
                return self._returned(start, run_id)
            except RunStoppedError:
                self.was_moved()
                if not self._is_simulated:
                    wait_until_seen(self._rig.link, self._neutral, on_progress=self._rig.on_progress)
        return self._returned(start, run_id)

    def _returned(self, start: Pose, run_id: str) -> ReturnResult:
        if not self._stands:
            self._rig.link.reset(start, run_key=run_id)
            self._stands = True
        return self._returner.bring_to(start)

    def was_moved(self) -> None:
        """Reset the vehicle before the next run."""
        self._stands = not self._is_simulated


PLACERS: Mapping[str, type[Placer]] = {"auto": Auto, "operator": Operator, "teleport": Teleport}


def choose_placer(name: str, *, simulated: bool) -> type[Placer]:
    """Return the placer called `name`; where that is empty, the usual one.

    Raises
    ------
    FlagError
        If it cannot place such a vehicle.
    """
    usable = [n for n, placer in PLACERS.items() if (placer.places_simulated if simulated else placer.places_real)]
    chosen = name or ("teleport" if simulated else "operator")
    if chosen not in usable:
        vehicle = "a simulated vehicle" if simulated else "a real vehicle"
        raise FlagError(f"{vehicle} cannot be placed so", where="--place", value=chosen, limit=OneOf(usable))
    return PLACERS[chosen]


def make_placer(name: str, rig: Rig) -> Placer:
    """Return the placer called `name` with the vehicle of `rig`; errors are those of `choose_placer`."""
    return choose_placer(name, simulated=rig.link.identity().simulated)(rig)
