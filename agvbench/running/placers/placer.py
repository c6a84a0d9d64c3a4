"""What a way of placing promises, and what it is given."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from agvbench.model import VehicleModel
from agvbench.planning import Workspace
from agvbench.running.links import RunnerLink
from agvbench.running.placing import say
from agvbench.running.quality import QualityLimits
from agvbench.running.returning.placing import Placing
from agvbench.running.supervision import Supervisor
from agvbench.types import Command, Pose


@dataclass(frozen=True)
class Rig:
    """What vehicles are placed with: link, nominal model, who watches where, and what tells the operator."""

    link: RunnerLink
    model: VehicleModel
    workspace: Workspace
    supervisor: Supervisor
    limits: QualityLimits
    tell: Callable[[str], None] = say


class Placer(ABC):
    """Brings the vehicle to the start of each run; `PLACERS` says what ``--place`` calls it."""

    places_simulated: ClassVar[bool]
    places_real: ClassVar[bool]

    def __init__(self, rig: Rig) -> None:
        self._rig = rig

    @property
    def _neutral(self) -> Command:
        """The command at which the vehicle stands."""
        return Command(*[self._rig.model.neutral] * 3)

    @abstractmethod
    def place(self, start: Pose, run_id: str) -> Placing | None:
        """Bring the vehicle to `start` (floor frame) for the run `run_id`; None if there is nothing to tell of it.

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
        """Take note that a simulated vehicle was stopped, or drove a recorded run unseen: nobody knows where it is."""
