"""Bring a differential vehicle to a start pose: turn on the spot towards it, drive straight there, turn on the spot.

The vehicle turns about its *pivot*, the middle of the axle, which is what drives straight. Where it lies relative to
the markers is learned from the turns: a marker that is mounted off the centre line moves on a circle about it.

References
----------
R. Siegwart, I. Nourbakhsh and D. Scaramuzza, Introduction to autonomous mobile robots (2011), section 3.6; the law that
follows the line is that of `agvbench.running.positioning.automatic_return.leg_drive`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from agvbench.errors import PlacingError, VehicleError
from agvbench.model import VehicleModel
from agvbench.running.positioning.automatic_return.leg_drive import TICK_S
from agvbench.running.positioning.automatic_return.motion_interface import MotionInterface
from agvbench.running.positioning.automatic_return.pose_returner import PoseReturner
from agvbench.types import Command, Floats, Pose, wrap_angle
from agvbench.vehicle.channels import Channel, Role

_FASTEST_RADPS = 0.6
_GAIN_PER_S, _INTEGRAL_PER_S2 = 1.2, 0.3
"""Of the controllers of heading and distance: the response takes the time in which a command shows twice over."""
_NEAR_RAD, _NEAR_M = 0.15, 0.05
"""Errors are integrated from here on, so that a dead band leaves none."""
_TURNED_RAD, _ARRIVED_M = math.radians(0.4), 0.0015
_NEAREST_M = 0.002
"""A pivot so near its place needs no drive."""
_DONE_TICKS, _STUCK_S, _PATIENCE_S = 3, 2.0, 20.0
_MOVED_RAD, _MOVED_M = 0.03, 0.01
_LEAST_TURN_RAD, _LEARNED_SHARE, _FARTHEST_LEVER_M = 0.5, 0.7, 0.05


class TurnAndDrive(PoseReturner):
    """Brings one differential vehicle to start poses; parameters as for `PoseReturner`."""

    def _set_up(self) -> None:
        self._stated = np.array([-self._model.geometry.rear_axle_m, 0.0])
        self._lever = self._stated.copy()  # from the markers' centroid to the pivot, in the vehicle frame [m]

    def _attempt(self, seen: Pose, start: Pose, motion_interface: MotionInterface) -> None:
        here, there = self._pivot(seen), self._pivot(start)
        if math.dist(here, there) > _NEAREST_M:
            course = math.atan2(there[1] - here[1], there[0] - here[0])
            backward = _is_shorter_backward(seen.heading_rad, course, start.heading_rad)
            heading = course + math.pi if backward else course
            self._require_room(seen, start)
            seen = self._turn(seen, heading, motion_interface)
            self._drive(self._pivot(seen), there, motion_interface, sign=-1.0 if backward else 1.0)
            seen = self._look(motion_interface)
        self._turn(seen, start.heading_rad, motion_interface)

    def _pivot(self, pose: Pose) -> tuple[float, float]:
        x, y = np.array(pose[:2]) + _rotation(pose.heading_rad) @ self._lever
        return float(x), float(y)

    def _require_room(self, seen: Pose, start: Pose) -> None:
        """Raise `PlacingError` if an end of the straight is outside: a workspace is convex, and contains the rest."""
        for what, pose in (("the vehicle", seen), ("the start", start)):
            inside_m = float(self._workspace.clearances(np.array([pose[:2]])).min())
            if inside_m < 0.0:
                raise PlacingError(
                    "the vehicle cannot drive back to its start", where=f"workspace {self._workspace.name}",
                    value=f"{what} is {-inside_m:.2f} m outside", remedy="put it there by hand",
                )  # fmt: skip

    def _turn(self, seen: Pose, heading_rad: float, motion_interface: MotionInterface) -> Pose:
        """Turn on the spot to a heading; return where the vehicle stands then, and learn its pivot."""
        fastest = min(_FASTEST_RADPS, 0.8 * _to_both_sides("turn left and right", self._model.front.output_range))

        def error(pose: Pose) -> float:
            return wrap_angle(heading_rad - pose.heading_rad)

        controller = _Controller(fastest, _NEAR_RAD, _TURNED_RAD, _MOVED_RAD)
        self._regulate(motion_interface, error, controller, lambda rate, _: self._command(0.0, rate))
        after = self._look(motion_interface)
        self._learn(seen, after)
        return after

    def _drive(
        self, here: tuple[float, float], there: tuple[float, float], motion_interface: MotionInterface, *, sign: float
    ) -> None:
        """Drive along the line from `here` to `there`, forward or (`sign` −1) backward."""
        course = math.atan2(there[1] - here[1], there[0] - here[0])
        c, s = math.cos(course), math.sin(course)
        heading = course if sign > 0.0 else course + math.pi
        reach = _to_both_sides("drive forward and backward", self._model.drive.output_range)
        fastest = min(self._limits.fast_mps, 0.8 * reach)
        length = max(0.15, fastest * self._limits.die_off_s)

        def left_m(pose: Pose) -> float:
            x, y = self._pivot(pose)
            return c * (there[0] - x) + s * (there[1] - y)

        def command(speed: float, pose: Pose) -> Command:
            x, y = self._pivot(pose)
            # In the vehicle's own left, whichever way it drives; see the law of `leg_drive`.
            offset = sign * (c * (y - there[1]) - s * (x - there[0]))
            offset = min(0.7 * length, max(-0.7 * length, offset))
            off_course = math.sin(wrap_angle(pose.heading_rad - heading))
            curvature = -offset / length**2 - 2.0 * sign * off_course / length
            return self._command(sign * speed, sign * speed * curvature)

        controller = _Controller(fastest, _NEAR_M, _ARRIVED_M, _MOVED_M)
        self._regulate(motion_interface, left_m, controller, command)

    def _regulate(
        self,
        motion_interface: MotionInterface,
        error: Callable[[Pose], float],
        controller: _Controller,
        command: Callable[[float, Pose], Command],
    ) -> None:
        """Hold commands until `error` of the pose stays within tolerance, or patience ends."""
        motion_interface.begin()
        pose = motion_interface.pose_estimator.pose
        assert pose is not None  # noqa: S101  (a return begins where the vehicle was seen)
        first, done = error(pose), 0
        until_s = motion_interface.now_s + _PATIENCE_S + abs(first) / (0.5 * controller.fastest)
        while done < _DONE_TICKS and motion_interface.now_s < until_s:
            left = error(pose)
            done = done + 1 if abs(left) <= controller.tolerance else 0
            motion_interface.hold(command(0.0 if done else controller.step(left), pose), TICK_S)
            pose = motion_interface.pose_estimator.pose or pose
            self._check(controller, first, error(pose))

    def _check(self, controller: _Controller, first: float, left: float) -> None:
        if controller.fast_s > _STUCK_S and abs(left - first) < controller.moved:
            raise PlacingError(
                "the vehicle does not move", where=self._link.keys.root, value=f"commanded for {_STUCK_S:g} s",
                remedy="see to its battery and wheels, then go on with --resume",
            )  # fmt: skip
        if abs(left) > abs(first) + 5.0 * controller.moved and abs(first) > controller.moved:
            raise PlacingError(
                "the vehicle moves the other way than commanded", where=self._link.keys.root,
                remedy="give the right file with --vehicle",
            )  # fmt: skip

    def _command(self, speed_mps: float, yaw_rate_radps: float) -> Command:
        drive, front = self._inverse("drive", speed_mps), self._inverse("front", yaw_rate_radps)
        return self._model.channels.limited(Command(drive, front, self._model.neutral.rear))

    def _inverse(self, role: Role, output: float) -> float:
        """Return the command of a channel for an `output` within its range; neutral where there is none."""
        static_map, channel = getattr(self._model, role), _channel(self._model, role)
        if output == 0.0:
            return channel.neutral
        try:
            command = float(static_map.inverse(np.clip(output, *static_map.output_range)))
        except VehicleError:
            return channel.neutral
        return min(channel.high, max(channel.low, command))

    def _learn(self, before: Pose, after: Pose) -> None:
        """Move the pivot towards the centre of a turn on the spot: ``R₂ l − R₁ l = p₁ − p₂``."""
        if abs(wrap_angle(after.heading_rad - before.heading_rad)) < _LEAST_TURN_RAD:
            return
        turned = _rotation(after.heading_rad) - _rotation(before.heading_rad)
        found = np.linalg.solve(turned, np.array(before[:2]) - np.array(after[:2]))
        if float(np.hypot(*(found - self._stated))) < _FARTHEST_LEVER_M:
            self._lever += _LEARNED_SHARE * (found - self._lever)


class _Controller:
    """A proportional controller up to ``fastest``, with an integral near its end.

    ``near`` is the error below which it integrates, ``tolerance`` the one at which it is done; ``moved`` is a change of
    the error that is no noise. ``fast_s`` is how long [s] it has asked for full speed.
    """

    def __init__(self, fastest: float, near: float, tolerance: float, moved: float) -> None:
        self.fastest, self.tolerance, self.moved = fastest, tolerance, moved
        self._near, self._sum, self.fast_s = near, 0.0, 0.0

    def step(self, error: float) -> float:
        """Return the speed to command for an error, both signed."""
        self._sum = self._sum + error * TICK_S if abs(error) < self._near and self._sum * error >= 0.0 else 0.0
        wanted = _GAIN_PER_S * error + _INTEGRAL_PER_S2 * self._sum
        self.fast_s = self.fast_s + TICK_S if abs(wanted) >= self.fastest else 0.0
        return min(self.fastest, max(-self.fastest, wanted))


def _is_shorter_backward(from_rad: float, course_rad: float, to_rad: float) -> bool:
    """Return whether less is turned in all if the vehicle drives the course backward."""

    def turned(heading_rad: float) -> float:
        return abs(wrap_angle(heading_rad - from_rad)) + abs(wrap_angle(to_rad - heading_rad))

    return turned(course_rad + math.pi) < turned(course_rad)


def _channel(model: VehicleModel, role: Role) -> Channel:
    channel: Channel = getattr(model.channels, role)
    return channel


def _rotation(heading_rad: float) -> Floats:
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([[c, -s], [s, c]])


def _to_both_sides(what: str, reached: tuple[float, float]) -> float:
    """Return how far a range reaches to either side of zero; raise `PlacingError` if it does not."""
    low, high = reached
    if low >= 0.0 or high <= 0.0:
        raise PlacingError(
            f"the vehicle cannot {what}, as the return path needs", value=f"{low:g} … {high:g}",
            remedy="put it there by hand",
        )  # fmt: skip
    return min(-low, high)
