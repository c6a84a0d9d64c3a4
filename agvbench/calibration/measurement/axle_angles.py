"""Signed axle angles from the arc that a vehicle drives (thesis section 6.2.2, appendix A)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.kinematics import axle_angles


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
