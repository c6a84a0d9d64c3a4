"""Drive a vehicle back to a start pose: plan, follow, stop, look, and again until it stands where it should."""

from __future__ import annotations

import math

from agvbench.errors import PlacingError, PlanError
from agvbench.model import VehicleModel
from agvbench.planning import Workspace
from agvbench.planning.shortest_paths.return_path import GearLeg, Guided, way_back
from agvbench.running.links import RunnerLink
from agvbench.running.rest import is_at_rest, pose_before
from agvbench.running.returning.aim import Aim
from agvbench.running.returning.habits import Habits
from agvbench.running.returning.helm import Helm
from agvbench.running.returning.leg_drive import LegDrive
from agvbench.running.returning.limits import DEFAULT_RETURN, ReturnLimits
from agvbench.running.returning.placing import Placing
from agvbench.running.returning.reins import Reins
from agvbench.running.supervision import Supervisor
from agvbench.types import Pose, wrap_angle

_RADII = (1.5, 1.0, 0.75)
"""Of the radius to plan with, widest first: turns as gentle as the floor allows."""
_LEADS = (2.7, 2.0, 1.4)
"""Of the wheelbase: the straight into the start, on which errors die off."""


class Returner:
    """Brings one vehicle to start poses, and learns its habits as it does.

    Parameters
    ----------
    link, supervisor
        What to drive with; the supervisor's rules hold here as they do in runs.
    model
        What is believed of the vehicle; it may be wrong in every number, but not in the sense of its commands.
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
        self._link, self._supervisor, self._helm = link, supervisor, Helm(model)
        self._workspace, self._limits = workspace, limits
        self._habits = Habits()

    def bring_to(self, start: Pose) -> Placing:
        """Drive to `start` (floor frame) and return how it went; the vehicle stands still, its commands neutral.

        Raises
        ------
        SafetyStopError
            If the supervisor stopped the vehicle.
        PlacingError
            If there is no way inside the workspace, or the vehicle is not there after all attempts, or does not do what
            it is told.
        LinkError
            If the bus or an adapter fails.
        """
        reins = Reins(self._link, self._supervisor)
        try:
            return self._bring_to(start, reins)
        except BaseException:
            # As in a run: before anything else the vehicle stands still.
            self._link.stop()
            raise

    def _bring_to(self, start: Pose, reins: Reins) -> Placing:
        limits, aim = self._limits, Aim(start)
        for attempt in range(limits.most_attempts + 1):
            seen = self._look(reins)
            off_m, off_rad = math.dist(seen[:2], start[:2]), abs(wrap_angle(seen.heading_rad - start.heading_rad))
            if max(off_m / limits.position_m, off_rad / limits.heading_rad) <= limits.reserve:
                return Placing(reins.now_s, attempt, off_m, off_rad)
            aim.came_to(seen)
            if attempt < limits.most_attempts:
                self._drive_way(seen, aim, reins)
        raise PlacingError(
            "the vehicle did not come to its start", where=self._link.keys.root,
            value=f"{off_m * 1e3:.1f} mm and {math.degrees(off_rad):.2f}° off after {limits.most_attempts} attempts",
            limit=f"{limits.position_m * 1e3:g} mm and {math.degrees(limits.heading_rad):g}°",
            remedy="put it there by hand, and go on with --resume",
        )  # fmt: skip

    def _look(self, reins: Reins) -> Pose:
        """Return where the vehicle stands, once it does."""
        reins.begin()
        until_s = reins.now_s + self._limits.settle_limit_s
        while True:
            frames = reins.hold(self._helm.neutral, self._limits.look_s)
            seen = pose_before(frames, reins.now_s)
            if seen is not None and is_at_rest(frames, until_s=reins.now_s):
                return seen
            if reins.now_s >= until_s:
                raise PlacingError("the vehicle does not come to rest", where=self._link.keys.root,
                                limit=f"{self._limits.settle_limit_s:g} s")  # fmt: skip

    def _drive_way(self, seen: Pose, aim: Aim, reins: Reins) -> None:
        """Drive a way until its end, or until the vehicle is astray."""
        crab_rad = self._habits.crab_rad
        try:
            legs = self._way(seen, aim, crab_rad)
        except PlanError as error:
            if aim.is_plain:
                raise PlacingError(
                    error.what, where=error.where, value=error.value, limit=error.limit, remedy=error.remedy
                ) from None
            return aim.begin_anew()
        for leg in legs:
            goal_crab_rad = crab_rad if leg is legs[-1] else None
            drive = LegDrive(leg, reins, self._helm, self._habits, self._limits, goal_crab_rad=goal_crab_rad)
            if not drive.run():
                return aim.begin_anew()
        return aim.took(legs[-1].backward)

    def _way(self, seen: Pose, aim: Aim, crab_rad: float) -> list[GearLeg]:
        geometry, radius_m = self._helm.model.geometry, self._helm.radius_m
        guided = Guided(geometry, self._helm.ahead_m, crab_rad)
        radii_m = [share * radius_m for share in _RADII]
        leads_m = [share * geometry.wheelbase_m for share in _LEADS]
        return way_back(seen, aim.pose, guided, self._workspace, radii_m=radii_m, leads_m=leads_m, gears=aim.gears)
