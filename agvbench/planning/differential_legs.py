"""Segments as a differential vehicle drives them: a forward speed and a yaw rate, and turns on the spot.

The centre of rotation lies beside the axle, so that a marker centroid ahead of it moves on its circle at a constant
angle to its heading: as on a vehicle whose front axle alone steers.
"""

from __future__ import annotations

import math

from agvbench.errors import PlanError, UnsuitedVehicleError
from agvbench.model import VehicleModel
from agvbench.planning.leg import Leg, leg_along, signed_speed
from agvbench.planning.trajectories.segments import Arc, SpotTurn, Straight, share_of_full
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
    speed = signed_speed(segment, trajectory, model, where=where)
    if isinstance(segment, Arc):
        yaw_rate = _arc_yaw_rate(segment, speed, model, where=where)
    elif segment.crab_deg:
        raise UnsuitedVehicleError(
            "a differential vehicle moves along its heading only", where=where, value=f"crab_deg = {segment.crab_deg:g}"
        )
    else:
        yaw_rate = 0.0
    return leg_along(segment, yaw_rate, 0.0, speed, model.geometry, where=where)


def _arc_yaw_rate(segment: Arc, speed_mps: float, model: VehicleModel, *, where: str) -> float:
    """Return the yaw rate [rad/s] that keeps the centroid on the arc's circle."""
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
    return yaw_rate


def _largest_yaw_rate(model: VehicleModel, *, left: bool) -> float:
    """Return how fast the vehicle can turn to a side [rad/s, positive]."""
    low, high = model.front.output_range
    return max(high if left else -low, 0.0)


def _spot_turn(segment: SpotTurn, model: VehicleModel, *, where: str) -> Leg:
    side = 1.0 if segment.turn == "left" else -1.0
    full = _largest_yaw_rate(model, left=side > 0.0)
    rate = segment.yaw_rate
    if isinstance(rate, str):
        rate = share_of_full(rate, full, "yaw rate", "its map", "rad/s", where=where)
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
