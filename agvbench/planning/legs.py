"""From the segments of a trajectory to legs: segments as this vehicle drives them, with the rests between them."""

from __future__ import annotations

import math

from agvbench.errors import PlanError, UnsuitedVehicleError
from agvbench.model import VehicleModel
from agvbench.planning.differential_legs import differential_leg
from agvbench.planning.leg import Leg, leg_along, signed_speed
from agvbench.planning.steering import axle_angles, radius_of, smallest_radius
from agvbench.planning.trajectories.segments import Arc, Pause, SpotTurn, Steering, Straight
from agvbench.planning.trajectories.trajectory import Trajectory

_MOUNTED_OFF_RAD = math.radians(3.0)


def legs_of(trajectory: Trajectory, model: VehicleModel) -> list[Leg]:
    """Return the legs of a trajectory, with the rests in which the steering is set.

    Raise `PlanError` if an axle angle is beyond its end stops or a speed beyond what the drive reaches.
    """
    segments = trajectory.expand()
    leg_of = differential_leg if model.geometry.is_differential else _leg
    driven = [
        segment.duration_s
        if isinstance(segment, Pause)
        else leg_of(segment, trajectory, model, where=trajectory.segment_name(i))
        for i, segment in enumerate(segments)
    ]
    # A differential vehicle has no steering to set.
    steer_first_s = 0.0 if model.geometry.is_differential else trajectory.steer_first_s
    return _with_rests(driven, steer_first_s, at_every_change=trajectory.steer_at_rest, where=trajectory.name)


def _leg(segment: Straight | Arc | SpotTurn, trajectory: Trajectory, model: VehicleModel, *, where: str) -> Leg:
    """Return the leg that drives a segment with two axles."""
    if isinstance(segment, SpotTurn):
        raise UnsuitedVehicleError(
            "a vehicle with steered axles cannot turn on the spot", where=where, remedy="drive an arc"
        )
    front, rear = _angles(segment, segment.steering or trajectory.steering, model, where=where)
    speed = signed_speed(segment, trajectory, model, where=where)
    return leg_along(segment, front, rear, speed, model.geometry, where=where)


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
    front, rear = as_mounted(front, rear, model)
    for axle, angle in (("front", front), ("rear", rear)):
        _check_end_stop(f"turn radius {radius:.2f} m", axle, angle, model, where, _widen(mode, model))
    return front, rear


def _straight_angles(segment: Straight, mode: Steering, model: VehicleModel, *, where: str) -> tuple[float, float]:
    crab = math.radians(segment.crab_deg)
    if crab and mode != "crab":
        raise PlanError("crab_deg needs crab steering", where=where, value=mode, remedy='say steering = "crab"')
    front, rear = as_mounted(crab, crab, model)
    for axle, angle in (("front", front), ("rear", rear)):
        what = f"moving at {segment.crab_deg:.1f}° to the heading" if crab else "a straight"
        _check_end_stop(
            what, axle, angle, model, where, "calibrate the steering" if not crab else "choose a smaller angle"
        )
    return front, rear


def as_mounted(front_rad: float, rear_rad: float, model: VehicleModel) -> tuple[float, float]:
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
    steers = (before.front, before.rear) != (after.front, after.rear)
    if before.is_rest:
        return steers
    return before.speed_mps * after.speed_mps < 0.0 or (at_every_change and steers)


def _rest(leg: Leg, duration_s: float) -> Leg:
    return Leg(leg.where, leg.front, leg.rear, 0.0, duration_s, is_rest=True)
