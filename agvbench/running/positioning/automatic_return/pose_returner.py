"""Bring a vehicle to a start pose: look, drive, and look again, until it is there."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

from agvbench.errors import PlacingError
from agvbench.model import VehicleModel
from agvbench.planning import Workspace
from agvbench.running.links import RunnerLink
from agvbench.running.positioning.automatic_return.leg_drive import DEFAULT_RETURN, ReturnLimits
from agvbench.running.positioning.automatic_return.motion_interface import MotionInterface
from agvbench.running.rest_detection import is_at_rest, pose_before
from agvbench.running.supervision.supervisor import Supervisor
from agvbench.types import Pose, wrap_angle


@dataclass(frozen=True)
class ReturnResult:
    """How a vehicle came to its start: time taken [s], ways driven, and how far off it was seen at rest [m, rad]."""

    duration_s: float
    attempts: int
    position_error_m: float
    heading_error_rad: float

    def columns(self) -> dict[str, object]:
        """Return what a campaign's runs table says of it."""
        return {f"placing_{name}": value for name, value in vars(self).items()}


class PoseReturner(ABC):
    """Brings one vehicle to start poses; a subclass drives one attempt.

    Parameters
    ----------
    link, supervisor
        What to drive with; the supervisor's rules hold here as they do in runs.
    model
        The nominal model; it may be wrong in every number, but not in the sense of its commands.
    workspace
        Where to stay.
    """

    def __init__(
        self,
        link: RunnerLink,
        model: VehicleModel,
        workspace: Workspace,
        supervisor: Supervisor,
        limits: ReturnLimits = DEFAULT_RETURN,
    ) -> None:
        self._link, self._model, self._supervisor = link, model, supervisor
        self._workspace, self._limits = workspace, limits
        self._set_up()

    def _set_up(self) -> None:  # noqa: B027  (not every vehicle is learned)
        """Prepare what is learned of the vehicle, from one start to the next."""

    def bring_to(self, start: Pose) -> ReturnResult:
        """Drive to `start` (floor frame) and return how it went; the vehicle stands still, its commands neutral.

        Raises
        ------
        SafetyStopError
            If the supervisor stopped the vehicle.
        PlacingError
            If there is no way inside the workspace, or the vehicle is not there after all attempts, or does not follow
            its commands.
        LinkError
            If the bus or an adapter fails.
        """
        motion_interface = MotionInterface(self._link, self._supervisor)
        try:
            return self._bring_to(start, motion_interface)
        except BaseException:
            # As in a run: before anything else the vehicle stands still.
            self._link.stop()
            raise

    def _begin(self, start: Pose) -> None:  # noqa: B027  (not every vehicle learns over attempts)
        """Take note that attempts at another start begin."""

    @abstractmethod
    def _attempt(self, seen: Pose, start: Pose, motion_interface: MotionInterface) -> None:
        """Drive once from where the vehicle was seen at rest towards `start`, and come to rest."""

    def _bring_to(self, start: Pose, motion_interface: MotionInterface) -> ReturnResult:
        limits = self._limits
        self._begin(start)
        for attempt in range(limits.most_attempts + 1):
            seen = self._look(motion_interface)
            off_m, off_rad = math.dist(seen[:2], start[:2]), abs(wrap_angle(seen.heading_rad - start.heading_rad))
            if max(off_m / limits.position_m, off_rad / limits.heading_rad) <= limits.reserve:
                return ReturnResult(motion_interface.now_s, attempt, off_m, off_rad)
            if attempt < limits.most_attempts:
                self._attempt(seen, start, motion_interface)
        raise PlacingError(
            "the vehicle did not come to its start", where=self._link.keys.root,
            value=f"{off_m * 1e3:.1f} mm and {math.degrees(off_rad):.2f}° off after {limits.most_attempts} attempts",
            limit=f"{limits.position_m * 1e3:g} mm and {math.degrees(limits.heading_rad):g}°",
            remedy="put it there by hand, and go on with --resume",
        )  # fmt: skip

    def _look(self, motion_interface: MotionInterface) -> Pose:
        """Return where the vehicle stands, once it does."""
        motion_interface.begin()
        until_s = motion_interface.now_s + self._limits.settle_limit_s
        while True:
            frames = motion_interface.hold(self._model.neutral, self._limits.look_s)
            seen = pose_before(frames, motion_interface.now_s)
            if seen is not None and is_at_rest(frames, until_s=motion_interface.now_s):
                return seen
            if motion_interface.now_s >= until_s:
                raise PlacingError("the vehicle does not come to rest", where=self._link.keys.root,
                                limit=f"{self._limits.settle_limit_s:g} s")  # fmt: skip
