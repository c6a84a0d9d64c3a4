"""Rigid-body kinematics of a vehicle with two steered axles (thesis eq. 5.6–5.10, corrected).

The vehicle frame has its origin at the marker centroid, x forward, y to the left. Both axle angles are
counter-clockwise positive: equal angles are crab, opposite angles are opposite steering. The thesis prints
``lr cos δr`` in eq. 5.6, where the speed vr belongs, and ``tan δf + tan δr`` in eq. 5.8, which
contradicts its eq. 5.7; both follow from a rigid body whose axle points move along their wheels:

- forward speed of the centroid u = (vf cos δf + vr cos δr) / 2 (the two are equal if nothing slips); with one driven
  axle u = vf cos δf or u = vr cos δr
- speed to the left w = u (lf tan δr + lr tan δf) / (lf + lr)
- yaw rate ψ̇ = u (tan δf − tan δr) / (lf + lr)

The other way round, a motion implies the axle angles, and so does an arc (thesis section 6.2.2, appendix A).

A differential vehicle (or a skid-steered one) has commands of forward speed and yaw rate in place of speed and angle.
Its centroid moves to the left with ψ̇ times its distance ahead of the axle.
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
        Axle angles [rad], counter-clockwise positive, within ±π/2; they and the speeds broadcast. The front value of a
        differential vehicle is its yaw rate [rad/s], and the rear one is ignored.
    front_mps, rear_mps
        Speeds of the axles along their wheels [m/s], forward positive; that of an axle that is not driven is ignored.
        The front one of a differential vehicle is the forward speed of its axle.
    geometry
        Where the axles are, and which of them drives.

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
    if geometry.is_differential:
        along, yaw_rate = np.broadcast_arrays(np.asarray(front_mps, dtype=np.float64), front)
        return along, geometry.rear_axle_m * yaw_rate, yaw_rate
    share = geometry.front_drive_share
    forward = share * np.asarray(front_mps) * np.cos(front) + (1.0 - share) * np.asarray(rear_mps) * np.cos(rear)
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
        v = u / cos β [m/s], negative when driving backward; (vf cos δf + vr cos δr) / (2 cos β) if both axles drive.
    sideslip
        β = arctan((lf tan δr + lr tan δf) / (lf + lr)) [rad]: the velocity points along heading + β (eq. 5.9, 5.10).
        It is ±π/2 for a differential vehicle that turns on the spot.
    yaw_rate
        ψ̇ = v cos β (tan δf − tan δr) / (lf + lr) [rad/s].
    """
    front, rear = np.asarray(front_rad, dtype=np.float64), np.asarray(rear_rad, dtype=np.float64)
    forward, left, yaw_rate = body_velocity(front, rear, front_mps, rear_mps, geometry)
    if geometry.is_differential:
        backward = forward < 0.0
        sideslip = np.arctan2(np.where(backward, -left, left), np.abs(forward))
        return np.where(backward, -1.0, 1.0) * np.hypot(forward, left), sideslip, yaw_rate
    lever = geometry.front_axle_m * np.tan(rear) + geometry.rear_axle_m * np.tan(front)
    sideslip = np.arctan(lever / geometry.wheelbase_m) + np.zeros_like(forward)
    return forward / np.cos(sideslip), sideslip, yaw_rate


def wheel_speed(forward_mps: ArrayLike, front_rad: ArrayLike, rear_rad: ArrayLike, geometry: Geometry) -> Floats:
    """Return the speed of the drive, along the wheels, that a forward speed of the centroid implies.

    The inverse of `body_velocity` for equal speeds of the driven axles: u / cos δ of the driven axle, and
    2 u / (cos δf + cos δr) if both drive (thesis eq. 5.6). It is u for a differential vehicle.

    Parameters
    ----------
    forward_mps
        Forward speed u of the centroid [m/s].
    front_rad, rear_rad
        Axle angles [rad] within ±π/2.
    geometry
        Which axle drives.
    """
    if geometry.is_differential:
        return np.asarray(forward_mps, dtype=np.float64) + np.zeros_like(np.asarray(front_rad, dtype=np.float64))
    share = geometry.front_drive_share
    return np.asarray(forward_mps, dtype=np.float64) / (share * np.cos(front_rad) + (1.0 - share) * np.cos(rear_rad))


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


def actuator_values(
    speed_forward: ArrayLike, speed_left: ArrayLike, yaw_rate: ArrayLike, geometry: Geometry
) -> tuple[Floats, Floats, Floats]:
    """Return what the actuators must have for a motion: front and rear angle [rad], and speed of the drive [m/s].

    The front value of a differential vehicle is its yaw rate [rad/s], and the rear one is zero. Parameters are those
    of `axle_angles`. Values are NaN where the motion does not determine them.
    """
    if geometry.is_differential:
        forward, yaw = np.broadcast_arrays(np.asarray(speed_forward, float), np.asarray(yaw_rate, float))
        return yaw, np.zeros_like(yaw), forward
    front, rear = axle_angles(speed_forward, speed_left, yaw_rate, geometry)
    return front, rear, wheel_speed(speed_forward, front, rear, geometry)


def axle_angles_from_arc(
    center: ArrayLike, x_m: ArrayLike, y_m: ArrayLike, heading_rad: ArrayLike, geometry: Geometry
) -> tuple[Floats, Floats]:
    """Return the axle angles of a vehicle that turns about `center`.

    The thesis projects the centre of the circle on the vehicle's centre line and distinguishes five cases: on the front
    axle, on the rear axle, between them, in front of them, behind them. With ξ the distance of that
    projection ahead of the markers' centroid and η that of the centre to the left, one signed formula holds for all::

        tan δf = (lf − ξ) / η        tan δr = (−lr − ξ) / η

    since an axle's wheels are square to the line from the axle to the centre. A centre on the right is a negative η.
    Which way the vehicle drives does not enter: backward, the wheels point along the same line. Cases 1 and 2 are
    ξ = lf and ξ = −lr, where an angle passes through zero (in appendix A they ask for exact equality, and case 1
    has the wrong sign). Straight motion is a centre at infinity: use `axle_angles_from_curvature`.

    Parameters
    ----------
    center
        Centre of the circle [m], shape (2,).
    x_m, y_m, heading_rad
        Pose of the marker centroid at each frame, floor frame.
    geometry
        Where the axles are.

    Returns
    -------
    front_rad, rear_rad
        In (−π/2, π/2), counter-clockwise positive, one for each pose; NaN for a centre on the centre line (η = 0).

    Examples
    --------
    A left turn about a centre abeam of the centroid, with opposite steering:

    >>> front, rear = axle_angles_from_arc((0.0, 1.0), 0.0, 0.0, 0.0, Geometry(0.181, 0.121))
    >>> round(float(np.tan(front)), 6), round(float(np.tan(rear)), 6)
    (0.181, -0.121)
    """
    cx, cy = np.asarray(center, dtype=np.float64)
    dx, dy = cx - np.asarray(x_m, dtype=np.float64), cy - np.asarray(y_m, dtype=np.float64)
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
    left = np.where(left == 0.0, np.nan, left)
    front = np.arctan((geometry.front_axle_m - ahead) / left)
    rear = np.arctan((-geometry.rear_axle_m - ahead) / left)
    return front, rear


def axle_angles_from_curvature(
    curvature_per_m: ArrayLike, sideslip_rad: ArrayLike, geometry: Geometry
) -> tuple[Floats, Floats]:
    """Return the axle angles of a vehicle on a path of given curvature: the same formula, straight motion included.

    With the centre at distance 1/κ, square to the direction of travel, ξ = −sin β / κ and η = cos β / κ, so that
    ``tan δf = (sin β + lf κ) / cos β`` and ``tan δr = (sin β − lr κ) / cos β``. Nothing is singular at κ = 0, where
    both angles are the crab angle β.

    Parameters
    ----------
    curvature_per_m
        Heading change per metre driven *forward* [1/m], left positive.
    sideslip_rad
        Direction of travel (when driving backward: its opposite) minus heading [rad], in (−π/2, π/2).
    geometry
        Where the axles are.

    Examples
    --------
    >>> [round(float(angle), 6) for angle in axle_angles_from_curvature(0.0, 0.2, Geometry(0.181, 0.121))]
    [0.2, 0.2]
    """
    return axle_angles(np.cos(sideslip_rad), np.sin(sideslip_rad), np.asarray(curvature_per_m), geometry)


def axle_angle_stderrs(
    curvature: float, curvature_stderr: float, sideslip: float, sideslip_stderr: float, geometry: Geometry
) -> tuple[float, float]:
    """Return the standard errors [rad] of both axle angles, from those of curvature and sideslip.

    The two are taken as independent: curvature is even about the middle of the arc, direction odd.
    """
    errors = []
    for lever in (geometry.front_axle_m, -geometry.rear_axle_m):
        q = (np.sin(sideslip) + lever * curvature) / np.cos(sideslip)
        by_curvature = lever / np.cos(sideslip) / (1.0 + q * q)
        by_sideslip = (1.0 + lever * curvature * np.sin(sideslip)) / np.cos(sideslip) ** 2 / (1.0 + q * q)
        errors.append(float(np.hypot(by_curvature * curvature_stderr, by_sideslip * sideslip_stderr)))
    return errors[0], errors[1]
