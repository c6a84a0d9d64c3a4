"""Rigid-body kinematics of a vehicle with two steered axles (thesis eq. 5.6–5.10, corrected).

The vehicle frame has its origin at the marker centroid, x forward, y to the left. Both axle angles are
counter-clockwise positive: equal angles are crab, opposite angles are opposite steering. The thesis prints
``lr cos δr`` in eq. 5.6, where the speed vr belongs, and ``tan δf + tan δr`` in eq. 5.8, which
contradicts its eq. 5.7; both follow from a rigid body whose axle points move along their wheels:

- forward speed of the centroid u = (vf cos δf + vr cos δr) / 2 (the two are equal if nothing slips)
- speed to the left w = u (lf tan δr + lr tan δf) / (lf + lr)
- yaw rate ψ̇ = u (tan δf − tan δr) / (lf + lr)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry


def body_velocity(
    front_rad: ArrayLike, rear_rad: ArrayLike, front_mps: ArrayLike, rear_mps: ArrayLike, geometry: Geometry
) -> tuple[Floats, Floats, Floats]:
    """Return the velocity of the marker centroid in the vehicle frame, and the yaw rate.

    Parameters
    ----------
    front_rad, rear_rad
        Axle angles [rad], counter-clockwise positive, within ±π/2; they and the speeds broadcast.
    front_mps, rear_mps
        Speeds of the axles along their wheels [m/s], forward positive.
    geometry
        Where the axles are.

    Returns
    -------
    speed_forward, speed_left, yaw_rate
        [m/s], [m/s], [rad/s].

    Examples
    --------
    >>> forward, left, yaw_rate = body_velocity(0.3, 0.3, 0.2, 0.2, Geometry(0.181, 0.121))
    >>> bool(np.isclose(left / forward, np.tan(0.3))), float(yaw_rate)
    (True, 0.0)
    """
    front, rear = np.asarray(front_rad, dtype=np.float64), np.asarray(rear_rad, dtype=np.float64)
    forward = 0.5 * (np.asarray(front_mps) * np.cos(front) + np.asarray(rear_mps) * np.cos(rear))
    tan_front, tan_rear = np.tan(front), np.tan(rear)
    left = forward * (geometry.front_axle_m * tan_rear + geometry.rear_axle_m * tan_front) / geometry.wheelbase_m
    return forward, left, forward * (tan_front - tan_rear) / geometry.wheelbase_m


def body_motion(
    front_rad: ArrayLike, rear_rad: ArrayLike, front_mps: ArrayLike, rear_mps: ArrayLike, geometry: Geometry
) -> tuple[Floats, Floats, Floats]:
    """Return speed, sideslip and yaw rate of the marker centroid (thesis eq. 5.6–5.8, corrected).

    Parameters are those of `body_velocity`.

    Returns
    -------
    speed
        v = (vf cos δf + vr cos δr) / (2 cos β) [m/s], negative when driving backward.
    sideslip
        β = arctan((lf tan δr + lr tan δf) / (lf + lr)) [rad]: the velocity points along heading + β (eq. 5.9, 5.10).
    yaw_rate
        ψ̇ = v cos β (tan δf − tan δr) / (lf + lr) [rad/s].
    """
    front, rear = np.asarray(front_rad, dtype=np.float64), np.asarray(rear_rad, dtype=np.float64)
    forward, _, yaw_rate = body_velocity(front, rear, front_mps, rear_mps, geometry)
    lever = geometry.front_axle_m * np.tan(rear) + geometry.rear_axle_m * np.tan(front)
    sideslip = np.arctan(lever / geometry.wheelbase_m) + np.zeros_like(forward)
    return forward / np.cos(sideslip), sideslip, yaw_rate


def axle_angles(
    speed_forward: ArrayLike, speed_left: ArrayLike, yaw_rate: ArrayLike, geometry: Geometry
) -> tuple[Floats, Floats]:
    """Return the axle angles that a motion of the rigid body implies: the inverse of `body_velocity`.

    The velocity of an axle's point is that of the centroid plus ω × r, and its wheels point along it.

    Parameters
    ----------
    speed_forward, speed_left
        Velocity of the marker centroid in the vehicle frame [m/s]; negative forward speed is driving backward.
    yaw_rate
        [rad/s], counter-clockwise positive.
    geometry
        Where the axles are.

    Returns
    -------
    front_rad, rear_rad
        Axle angles in (−π/2, π/2); NaN where the forward speed is zero, which determines nothing.
    """
    forward = np.asarray(speed_forward, dtype=np.float64)
    left, yaw = np.asarray(speed_left, dtype=np.float64), np.asarray(yaw_rate, dtype=np.float64)
    forward = np.where(forward == 0.0, np.nan, forward)
    front = np.arctan((left + geometry.front_axle_m * yaw) / forward)
    rear = np.arctan((left - geometry.rear_axle_m * yaw) / forward)
    return front, rear
