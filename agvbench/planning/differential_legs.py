"""Segments as a differential vehicle drives them: a forward speed and a yaw rate, and turns on the spot.

The centre of rotation lies beside the axle, so that a marker centroid ahead of it moves on its circle at a constant
angle to its heading: as on a vehicle whose front axle alone steers.
"""

from __future__ import annotations

import math

from agvbench.errors import PlanError, UnsuitedVehicleError
from agvbench.model import VehicleModel
from agvbench.planning.leg import Leg, full_speed
from agvbench.planning.trajectories.segments import Arc, SpotTurn, Straight, axle_speed, share_of
from agvbench.planning.trajectories.trajectory import Trajectory


def differential_leg(
    segment: Straight | Arc | SpotTurn, trajectory: Trajectory, model: VehicleModel, *, where: str
) -> Leg:
    """Return the leg that drives a segment.

    Raises
    ------
    PlanError
        If the speed or the yaw rate is out of reach, or the segment needs angles of axles.
    """
    if isinstance(segment, SpotTurn):
        return _spot_turn(segment, model, where=where)
    backward = segment.direction == "backward"
    asked = trajectory.speed if segment.speed is None else segment.speed
    speed = axle_speed(asked, full_speed(model, backward, where=where), where=where)
    signed = -speed if backward else speed
    if isinstance(segment, Straight):
        return _straight(segment, signed, where=where)
    return _arc(segment, signed, model, where=where)


def _straight(segment: Straight, speed_mps: float, *, where: str) -> Leg:
    if segment.crab_deg:
        raise UnsuitedVehicleError(
            "a differential vehicle moves along its heading only", where=where, value=f"crab_deg = {segment.crab_deg:g}"
        )
    if segment.duration_s is not None:
        return Leg(where, 0.0, 0.0, speed_mps, segment.duration_s)
    assert segment.length_m is not None  # noqa: S101 - a straight has a length or a duration
    return Leg(where, 0.0, 0.0, speed_mps, segment.length_m / abs(speed_mps))


def _arc(segment: Arc, speed_mps: float, model: VehicleModel, *, where: str) -> Leg:
    if segment.radius_m is None:
        raise UnsuitedVehicleError(
            "axle_angle_deg is an angle of an axle, and a differential vehicle steers none",
            where=where,
            remedy="give radius_m",
        )
    ahead = abs(model.geometry.rear_axle_m)
    if segment.radius_m <= ahead:
        raise PlanError(
            "turn radius is smaller than the distance of the marker centroid from the axle",
            where=where,
            value=f"{segment.radius_m:.2f} m",
            limit=f"more than {ahead:.3f} m",
            remedy="widen the turn, or turn on the spot",
        )
    beside = math.sqrt(segment.radius_m**2 - ahead**2)
    yaw_rate = (1.0 if segment.turn == "left" else -1.0) * speed_mps / beside
    largest = _largest_yaw_rate(model, left=yaw_rate > 0.0)
    if abs(yaw_rate) > largest * (1.0 + 1e-9):
        radius = math.hypot(abs(speed_mps) / max(largest, 1e-9), ahead)
        raise PlanError(
            f"turn radius {segment.radius_m:.2f} m at {abs(speed_mps):.2f} m/s needs {abs(yaw_rate):.2f} rad/s",
            where=where,
            limit=f"{largest:.2f} rad/s",
            remedy=f"slow down, or widen it to at least {math.ceil(radius * 100.0) / 100.0:.2f} m",
        )
    if segment.duration_s is not None:
        return Leg(where, yaw_rate, 0.0, speed_mps, segment.duration_s)
    if segment.angle_deg is not None:
        return Leg(where, yaw_rate, 0.0, speed_mps, math.radians(segment.angle_deg) / abs(yaw_rate))
    assert segment.length_m is not None  # noqa: S101 - an arc has one of the three
    return Leg(where, yaw_rate, 0.0, speed_mps, segment.length_m / (segment.radius_m * abs(yaw_rate)))


def _largest_yaw_rate(model: VehicleModel, *, left: bool) -> float:
    """Return how fast the vehicle can turn to a side [rad/s, positive]."""
    low, high = model.front.output_range
    return max(high if left else -low, 0.0)


def _spot_turn(segment: SpotTurn, model: VehicleModel, *, where: str) -> Leg:
    side = 1.0 if segment.turn == "left" else -1.0
    full = _largest_yaw_rate(model, left=side > 0.0)
    if isinstance(segment.yaw_rate, str):
        share = share_of(segment.yaw_rate)
        assert share is not None  # noqa: S101 - checked when the trajectory was read
        if not math.isfinite(full):
            raise PlanError(
                f"what {segment.yaw_rate} yaw rate is is not known: its map has no end", where=where,
                remedy="say it in rad/s",
            )  # fmt: skip
        rate = share * full
    else:
        rate = segment.yaw_rate
    if not 0.0 < rate <= full * (1.0 + 1e-9):
        raise PlanError(
            f"yaw rate is more than the vehicle reaches to the {segment.turn}",
            where=where,
            value=f"{rate:.3g} rad/s",
            limit=f"{full:.3g} rad/s",
            remedy='turn more slowly, or say "full"',
        )
    if segment.duration_s is not None:
        return Leg(where, side * rate, 0.0, 0.0, segment.duration_s)
    assert segment.angle_deg is not None  # noqa: S101 - a turn on the spot has an angle or a duration
    return Leg(where, side * rate, 0.0, 0.0, math.radians(segment.angle_deg) / rate)
