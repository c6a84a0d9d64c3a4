"""Heading from a tracker's quaternion, for any choice of floor axes and any body axis that points forward."""

from __future__ import annotations

import numpy as np

from agvbench.campaign.mapping_schema import Axis
from agvbench.types import Floats

_VERTICAL = 1e-3


def heading_of(quaternion: Floats, forward: Axis, floor_x: Axis, floor_y: Axis) -> Floats:
    """Return the heading [rad] of body axis `forward` on the floor, shape (n,).

    Parameters
    ----------
    quaternion
        Rotation from body to tracker axes, shape (n, 4), in the order x, y, z, w; any positive length.
    forward
        The body axis that points ahead.
    floor_x, floor_y
        The tracker axes that are the floor's x and y: (``"x"``, ``"-z"``) for a tracker with y up.

    Returns
    -------
    Floats
        NaN where the forward axis points up or down, or the quaternion is zero or not finite.

    Examples
    --------
    >>> quarter_turn_about_y = np.array([[0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)]])
    >>> np.degrees(heading_of(quarter_turn_about_y, "x", "x", "-z")).round(6)
    array([90.])
    """
    vector, scalar = quaternion[:, :3], quaternion[:, 3:]
    axis = _unit(forward)
    # Rotation of a vector by a quaternion that need not have length one: q a q* = |q|² R a.
    turned = (
        (scalar**2 - (vector**2).sum(axis=1, keepdims=True)) * axis
        + 2.0 * (vector @ axis)[:, None] * vector
        + 2.0 * scalar * np.cross(vector, axis)
    )
    ahead, left = turned @ _unit(floor_x), turned @ _unit(floor_y)
    defined = np.hypot(ahead, left) > _VERTICAL * (quaternion**2).sum(axis=1)
    return np.where(defined, np.arctan2(left, ahead), np.nan)


def _unit(axis: Axis) -> Floats:
    unit = np.zeros(3)
    unit["xyz".index(axis[-1])] = -1.0 if axis.startswith("-") else 1.0
    return unit
