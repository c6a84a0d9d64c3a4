"""Legs: segments as this vehicle drives them, each with constant axle angles and one speed; and their path."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from agvbench.errors import PlanError, UnsuitedVehicleError
from agvbench.model import VehicleModel
from agvbench.planning.steering import axle_angles, radius_of, smallest_radius
from agvbench.planning.trajectories.segments import Arc, Pause, Segment, Steering, Straight, axle_speed
from agvbench.planning.trajectories.trajectory import Trajectory
from agvbench.types import Floats, Pose, wrap_angle
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.kinematics import body_motion

_MOUNTED_OFF_RAD = math.radians(3.0)


@dataclass(frozen=True)
class Leg:
    """A stretch of time in which nothing about the vehicle's motion changes.

    Parameters
    ----------
    where
        How messages call it.
    front_rad, rear_rad
        Axle angles [rad].
    speed_mps
        Speed of both axles [m/s], signed; 0 at rest.
    duration_s
        Duration [s].
    """

    where: str
    front_rad: float
    rear_rad: float
    speed_mps: float
    duration_s: float

    @property
    def is_rest(self) -> bool:
        """Whether the vehicle stands still."""
        return self.speed_mps == 0.0


def legs_of(trajectory: Trajectory, model: VehicleModel) -> list[Leg]:
    """Return the legs of a trajectory, with the rests in which the steering is set.

    Raise `PlanError` if an axle angle is beyond its end stops or a speed beyond what the drive reaches.
    """
    segments = trajectory.expand()
    driven = [_leg(segment, trajectory, model, where=trajectory.segment_name(i)) for i, segment in enumerate(segments)]
    return _with_rests(
        driven, trajectory.steer_first_s, at_every_change=trajectory.steer_at_rest, where=trajectory.name
    )


def _leg(segment: Segment, trajectory: Trajectory, model: VehicleModel, *, where: str) -> Leg | float:
    """Return the leg that drives a segment, or the duration of a pause."""
    if isinstance(segment, Pause):
        return segment.duration_s
    front, rear = _angles(segment, segment.steering or trajectory.steering, model, where=where)
    speed = axle_speed(
        trajectory.speed if segment.speed is None else segment.speed,
        _full_speed(model, segment.direction == "backward", where=where),
        where=where,
    )
    signed = -speed if segment.direction == "backward" else speed
    centroid, _, yaw_rate = (abs(float(x)) for x in body_motion(front, rear, signed, signed, model.geometry))
    if segment.duration_s is not None:
        duration = segment.duration_s
    elif segment.length_m is not None:
        duration = segment.length_m / centroid
    else:
        assert isinstance(segment, Arc)  # noqa: S101 - a straight has a length or a duration
        assert segment.angle_deg is not None  # noqa: S101 - an arc has one of the three
        duration = math.radians(segment.angle_deg) / yaw_rate
    return Leg(where, front, rear, signed, duration)


def _full_speed(model: VehicleModel, backward: bool, *, where: str) -> float:
    low, high = model.drive.output_range
    full = -low if backward else high
    direction = "backward" if backward else "forward"
    if not full > 0.0:
        raise PlanError(f"this vehicle does not drive {direction}", where=where)
    return full


def _angles(segment: Straight | Arc, mode: Steering, model: VehicleModel, *, where: str) -> tuple[float, float]:
    if isinstance(segment, Straight):
        return _straight_angles(segment, mode, model, where=where)
    if mode == "crab":
        raise PlanError("crab steering cannot turn", where=where, remedy="use a straight with crab_deg")
    if segment.radius_m is not None:
        radius = segment.radius_m
    else:
        assert segment.axle_angle_deg is not None  # noqa: S101 - an arc has one of the two
        radius = radius_of(mode, math.radians(segment.axle_angle_deg), model.geometry)
    side = 1.0 if segment.turn == "left" else -1.0
    front, rear = (side * angle for angle in axle_angles(mode, radius, model.geometry, where=where))
    front, rear = _as_mounted(front, rear, model)
    for axle, angle in (("front", front), ("rear", rear)):
        _check_end_stop(f"turn radius {radius:.2f} m", axle, angle, model, where, _widen(mode, model))
    return front, rear


def _straight_angles(segment: Straight, mode: Steering, model: VehicleModel, *, where: str) -> tuple[float, float]:
    crab = math.radians(segment.crab_deg)
    if crab and mode != "crab":
        raise PlanError("crab_deg needs crab steering", where=where, value=mode, remedy='say steering = "crab"')
    front, rear = _as_mounted(crab, crab, model)
    for axle, angle in (("front", front), ("rear", rear)):
        what = f"moving at {segment.crab_deg:.1f}° to the heading" if crab else "a straight"
        _check_end_stop(
            what, axle, angle, model, where, "calibrate the steering" if not crab else "choose a smaller angle"
        )
    return front, rear


def _as_mounted(front_rad: float, rear_rad: float, model: VehicleModel) -> tuple[float, float]:
    """Return both angles turned by what an axle that does not steer is mounted off by, as calibration found it.

    Turned alike they keep a straight a straight, and an arc's curvature to first order.
    """
    for map_, angle in ((model.front, front_rad), (model.rear, rear_rad)):
        low, high = map_.output_range
        if low == high and abs(low - angle) <= _MOUNTED_OFF_RAD:
            return front_rad + low - angle, rear_rad + low - angle
    return front_rad, rear_rad


def _check_end_stop(what: str, axle: str, angle_rad: float, model: VehicleModel, where: str, remedy: str) -> None:
    low, high = (model.front if axle == "front" else model.rear).output_range
    if low - 1e-9 <= angle_rad <= high + 1e-9:
        return
    if low == high:
        raise UnsuitedVehicleError(
            f"{what} needs {math.degrees(angle_rad):.1f}° at the {axle} axle, which does not steer",
            where=where,
            remedy=f'say steering = "{"front" if axle == "rear" else "rear"}"',
        )
    limit = high if angle_rad > high else low
    raise PlanError(
        f"{what} needs {math.degrees(angle_rad):.1f}° at the {axle} axle",
        where=where,
        limit=f"{math.degrees(limit):.1f}°",
        remedy=remedy,
    )


def _widen(mode: Steering, model: VehicleModel) -> str:
    limits = [min(abs(low), abs(high)) for low, high in (model.front.output_range, model.rear.output_range)]
    smallest = smallest_radius(mode, limits[0], limits[1], model.geometry)
    # Rounded up, so that the advice holds.
    return f"widen it to at least {math.ceil(smallest * 100.0) / 100.0:.2f} m" if math.isfinite(smallest) else ""


def _with_rests(driven: list[Leg | float], steer_first_s: float, *, at_every_change: bool, where: str) -> list[Leg]:
    """Put a rest before the start, wherever the gear changes, and, if asked, wherever the steering does."""
    moving = [item for item in driven if isinstance(item, Leg)]
    if not moving:
        raise PlanError("nothing is driven: there are only pauses", where=where, remedy="add a straight or an arc")
    legs = [_rest(moving[0], steer_first_s)]
    for item in driven:
        if not isinstance(item, Leg):
            legs.append(_rest(legs[-1], item))
            continue
        before = legs[-1]
        if _needs_rest(before, item, at_every_change=at_every_change):
            legs.append(_rest(item, steer_first_s))
        legs.append(item)
    return [leg for leg in legs if leg.duration_s > 0.0]


def _needs_rest(before: Leg, after: Leg, *, at_every_change: bool) -> bool:
    steers = (before.front_rad, before.rear_rad) != (after.front_rad, after.rear_rad)
    if before.is_rest:
        return steers
    return before.speed_mps * after.speed_mps < 0.0 or (at_every_change and steers)


def _rest(leg: Leg, duration_s: float) -> Leg:
    return Leg(leg.where, leg.front_rad, leg.rear_rad, 0.0, duration_s)


_SWEPT_STEP_M = 0.005


def advance(leg: Leg, pose: tuple[float, float, float], after_s: Floats, geometry: Geometry) -> Floats:
    """Return the poses `after_s` seconds (n,) into a leg that begins at `pose`, shape (n, 3); heading unwrapped."""
    speed, sideslip, yaw_rate = _motion(leg, geometry)
    x, y, heading = pose
    turn = yaw_rate * after_s
    # The chord of an arc of angle 2a is its length times sin(a)/a, which is 1 on a straight.
    chord = speed * after_s * np.sinc(turn / (2.0 * np.pi))
    direction = heading + sideslip + 0.5 * turn
    return np.column_stack([x + chord * np.cos(direction), y + chord * np.sin(direction), heading + turn])


def _motion(leg: Leg, geometry: Geometry) -> tuple[float, float, float]:
    speed, sideslip, yaw_rate = body_motion(leg.front_rad, leg.rear_rad, leg.speed_mps, leg.speed_mps, geometry)
    return float(speed), float(sideslip), float(yaw_rate)


def sample(legs: Sequence[Leg], geometry: Geometry, step_s: float) -> Floats:
    """Return t [s], x [m], y [m], heading [rad, unwrapped] in the start frame, shape (n, 4).

    There is a row every `step_s` of each leg and at both of its ends.
    """
    rows = [np.zeros((1, 4))]
    for leg in legs:
        t, *pose = rows[-1][-1]
        steps = np.arange(step_s, leg.duration_s - 1e-9, step_s)
        after = np.append(steps, leg.duration_s)
        rows.append(np.column_stack([t + after, advance(leg, (pose[0], pose[1], pose[2]), after, geometry)]))
    return np.concatenate(rows)


def end_pose(path: Floats) -> Pose:
    """Return the last pose of a path (n, 4) as `sample` returns it."""
    x, y, heading = path[-1, 1:].tolist()
    return Pose(x, y, wrap_angle(heading))


def swept(legs: Sequence[Leg], geometry: Geometry) -> Floats:
    """Return when and where the centres of both axles pass: the floor that the vehicle's length needs.

    Returns
    -------
    t [s], x [m], y [m] in the start frame, shape (n, 3), a row of each axle every 5 mm of the centroid's path or
    less. Of circles driven over and over only the first is there, so that hours need no more rows than minutes.
    """
    t, pose = 0.0, (0.0, 0.0, 0.0)
    rows = [_axles(np.zeros(1), np.zeros((1, 3)), geometry)]
    for leg in legs:
        speed, _, yaw_rate = _motion(leg, geometry)
        once_s = min(leg.duration_s, 2.0 * np.pi / abs(yaw_rate)) if yaw_rate else leg.duration_s
        after = np.linspace(0.0, once_s, 2 + int(abs(speed) * once_s / _SWEPT_STEP_M))[1:]
        rows.append(_axles(t + after, advance(leg, pose, after, geometry), geometry))
        x, y, heading = advance(leg, pose, np.array([leg.duration_s]), geometry)[0].tolist()
        t, pose = t + leg.duration_s, (x, y, heading)
    return np.concatenate(rows)


def _axles(t_s: Floats, poses: Floats, geometry: Geometry) -> Floats:
    along = np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    front, rear = poses[:, :2] + geometry.front_axle_m * along, poses[:, :2] - geometry.rear_axle_m * along
    return np.column_stack([np.repeat(t_s, 2), np.stack([front, rear], axis=1).reshape(-1, 2)])


def axles_swept(path: Floats, geometry: Geometry) -> Floats:
    """Return when and where the axles' centres pass on a `path` (n, 4) of t, x, y, heading; shape (2n, 3)."""
    return _axles(path[:, 0], path[:, 1:], geometry)
