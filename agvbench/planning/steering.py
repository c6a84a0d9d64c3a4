"""Steering modes: where the centre of rotation lies, and the axle angles that put it there.

In the vehicle frame (x forward, y left, origin at the marker centroid) the centre of rotation is (x_c, y_c), and each
axle stands square to the line to it. A mode says x_c; the centroid's radius R = hypot(x_c, y_c) then says the rest:

=============  ==============  ===========================================================
mode           x_c             both axles steer so that
=============  ==============  ===========================================================
``abeam``      0               the centre is abeam of the centroid, which keeps to its heading
``front``      −l_r            only the front axle steers
``rear``       l_f             only the rear axle steers
``opposite``   (l_f − l_r)/2   the angles are equal and opposite
=============  ==============  ===========================================================

Whatever the mode, the centroid moves on the same circle through the same angle: a turn's chord and change of heading
do not depend on it, only the chord's direction does. ``crab`` has equal angles and no centre.
"""

from __future__ import annotations

import math

from agvbench.errors import PlanError
from agvbench.planning.trajectories.segments import Steering
from agvbench.vehicle.geometry import Geometry

_SQUARE = math.radians(89.0)
"""An axle without end stops may turn so far."""


def centre_forward(mode: Steering, geometry: Geometry) -> float:
    """Return x_c [m], how far the centre of rotation lies ahead of the centroid."""
    front, rear = geometry.front_axle_m, geometry.rear_axle_m
    return {"abeam": 0.0, "front": -rear, "rear": front, "opposite": 0.5 * (front - rear)}[mode]


def axle_angles(mode: Steering, radius_m: float, geometry: Geometry, *, where: str) -> tuple[float, float]:
    """Return the (front, rear) angles [rad] of a left turn on which the centroid's radius is `radius_m`.

    Raises
    ------
    PlanError
        If the centroid cannot come so close to the centre in this mode.

    Examples
    --------
    >>> front, rear = axle_angles("abeam", 1.0, Geometry(0.181, 0.121), where="turn")
    >>> round(math.degrees(front), 2), round(math.degrees(rear), 2)
    (10.26, -6.9)
    """
    ahead = centre_forward(mode, geometry)
    if radius_m <= abs(ahead):
        raise PlanError(
            f"turn radius is too small for {mode} steering at any angle",
            where=where,
            value=f"{radius_m:.2f} m",
            limit=f"more than {abs(ahead):.3f} m",
            remedy="widen the turn or steer abeam",
        )
    beside = math.sqrt(radius_m**2 - ahead**2)
    front = math.atan((geometry.front_axle_m - ahead) / beside)
    rear = math.atan((-geometry.rear_axle_m - ahead) / beside)
    return front, rear


def radius_of(mode: Steering, axle_angle_rad: float, geometry: Geometry) -> float:
    """Return the centroid's radius [m] where the steered axle (the front one of two) is at `axle_angle_rad` > 0."""
    ahead = centre_forward(mode, geometry)
    lever = geometry.wheelbase_m if mode == "rear" else geometry.front_axle_m - ahead
    return math.hypot(ahead, lever / math.tan(axle_angle_rad))


def smallest_radius(mode: Steering, front_limit_rad: float, rear_limit_rad: float, geometry: Geometry) -> float:
    """Return the smallest radius [m] at which neither axle is beyond its limit (both positive; infinite if none)."""
    ahead = centre_forward(mode, geometry)
    levers = (geometry.front_axle_m - ahead, geometry.rear_axle_m + ahead)
    beside = 0.0
    for lever, limit in zip(levers, (front_limit_rad, rear_limit_rad), strict=True):
        if lever > 0.0:
            beside = max(beside, lever / math.tan(min(limit, _SQUARE)) if limit > 0.0 else math.inf)
    return math.hypot(ahead, beside)
