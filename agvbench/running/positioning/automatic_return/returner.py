"""Drive a vehicle back to a start pose: plan, follow, stop, look, and correct the goal until it is there."""

from __future__ import annotations

from agvbench.errors import PlacingError, PlanError
from agvbench.planning.shortest_paths.return_path import GearLeg, Guided, plan_return_path
from agvbench.running.positioning.automatic_return.command_mapping import CommandMapping
from agvbench.running.positioning.automatic_return.leg_drive import LegDrive
from agvbench.running.positioning.automatic_return.motion_interface import MotionInterface
from agvbench.running.positioning.automatic_return.online_adaptation import OnlineAdaptation
from agvbench.running.positioning.automatic_return.pose_returner import PoseReturner
from agvbench.types import Pose, wrap_angle

_SHARE = 0.5
_FARTHEST_M, _FARTHEST_RAD = 0.03, 0.06
"""A larger residual says nothing of the next attempt."""
_MOST_IN_A_GEAR = 4


class GoalOffset:
    """The pose to aim at for a start, learned over the attempts of one return.

    A bias that repeats in one place (a slope, a camera's distortion, a drive that pulls to one side) is compensated,
    whatever its cause; so attempts come in one gear. Where that does not help (a seam in the floor just before the
    start), they come in the other.
    """

    def __init__(self, start: Pose) -> None:
        self._start, self.pose = start, start
        self._backward: bool | None = None
        self._attempts = 0

    @property
    def gears(self) -> tuple[bool, ...]:
        """The gears to come in: backward or not."""
        return (False, True) if self._backward is None else (self._backward,)

    @property
    def is_zero(self) -> bool:
        """Whether the aim is the start itself, in any gear."""
        return self._backward is None and self.pose == self._start

    def reset(self) -> None:
        """Aim at the start itself, in any gear."""
        self.pose, self._backward, self._attempts = self._start, None, 0

    def record_attempt(self, backward: bool) -> None:
        """Note the gear of an attempt that was driven to its end."""
        self._backward, self._attempts = backward, self._attempts + 1

    def update(self, seen: Pose) -> None:
        """Offset the goal by a share of the residual; after some attempts, come from the other side."""
        if self._backward is None:
            return
        if self._attempts >= _MOST_IN_A_GEAR:
            self.pose, self._backward, self._attempts = self._start, not self._backward, 0
            return
        residual = seen.relative_to(self._start)
        if max(abs(residual.x_m), abs(residual.y_m)) > _FARTHEST_M or abs(residual.heading_rad) > _FARTHEST_RAD:
            return
        off = self.pose.relative_to(self._start)
        x_m, y_m, heading_rad = (was - _SHARE * now for was, now in zip(off, residual, strict=True))
        self.pose = self._start.compose(Pose(x_m, y_m, wrap_angle(heading_rad)))


_RADII = (1.5, 1.0, 0.75)
"""Of the radius to plan with, widest first: turns as gentle as the floor allows."""
_LEADS = (2.7, 2.0, 1.4)
"""Of the wheelbase: the straight into the start, on which errors die off."""


class Returner(PoseReturner):
    """Brings one vehicle with steered axles to start poses, and adapts to it; parameters as for `PoseReturner`."""

    def _set_up(self) -> None:
        self._command_mapping, self._online_adaptation = CommandMapping(self._model), OnlineAdaptation()

    def _begin(self, start: Pose) -> None:
        self._goal_offset = GoalOffset(start)

    def _attempt(self, seen: Pose, start: Pose, motion_interface: MotionInterface) -> None:
        self._goal_offset.update(seen)
        self._drive_return_path(seen, self._goal_offset, motion_interface)

    def _drive_return_path(self, seen: Pose, goal_offset: GoalOffset, motion_interface: MotionInterface) -> None:
        """Drive a way until its end, or until the vehicle is astray."""
        crab_rad = self._online_adaptation.crab_rad
        try:
            legs = self._return_legs(seen, goal_offset, crab_rad)
        except PlanError as error:
            if goal_offset.is_zero:
                raise PlacingError(
                    error.what, where=error.where, value=error.value, limit=error.limit, remedy=error.remedy
                ) from None
            return goal_offset.reset()
        for leg in legs:
            goal_crab_rad = crab_rad if leg is legs[-1] else None
            drive = LegDrive(
                leg,
                motion_interface,
                self._command_mapping,
                self._online_adaptation,
                self._limits,
                goal_crab_rad=goal_crab_rad,
            )
            if not drive.run():
                return goal_offset.reset()
        return goal_offset.record_attempt(legs[-1].backward)

    def _return_legs(self, seen: Pose, goal_offset: GoalOffset, crab_rad: float) -> list[GearLeg]:
        geometry, radius_m = self._command_mapping.model.geometry, self._command_mapping.radius_m
        guided = Guided(geometry, self._command_mapping.forward_m, crab_rad)
        radii_m = [share * radius_m for share in _RADII]
        leads_m = [share * geometry.wheelbase_m for share in _LEADS]
        return plan_return_path(
            seen, goal_offset.pose, guided, self._workspace, radii_m=radii_m, leads_m=leads_m, gears=goal_offset.gears
        )
