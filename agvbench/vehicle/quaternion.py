"""Heading from a rigid body's quaternion, at the poles too (thesis eq. 6.1–6.4)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from agvbench.errors import InputError, OneOf
from agvbench.types import Floats, wrap_angle

Up = Literal["y", "z"]
Axis = Literal["x", "y", "z", "-x", "-y", "-z"]

# Within this of vertical (as the sine of the angle between the forward axis and the vertical) the forward axis has no
# direction on the floor left that float32 noise (6e-8) would not turn by a degree or more.
_POLE_SINE = 3e-6


def quaternion_to_heading(
    qx: ArrayLike, qy: ArrayLike, qz: ArrayLike, qw: ArrayLike, *, up: Up = "y"
) -> Floats | np.float64:
    """Return the heading [rad, counter-clockwise seen from above, in (−π, π]] of a body's forward axis (its x axis).

    Heading is the direction on the floor of the rotated x axis. With y up, as Motive streams it, the floor is
    (x, −z): the thesis mirrors z so that the figure is what one sees from above. The rotated x axis is then
    (1 − 2qy² − 2qz², 2qy qw − 2qx qz) on the floor, which is thesis eq. 6.1. It stays right under any pitch and
    roll: it is the projection of the forward axis, not a first-order Euler angle.

    At the poles (forward axis straight up or down, eq. 6.2: qx qy + qz qw = ±½) both terms of eq. 6.1 vanish, and
    eq. 6.3 and 6.4 take what is left, the heading before the body pitched up or down by 90°. The thesis switches at
    ±0.499, 3.6° before the pole, where eq. 6.1 still holds and eq. 6.3 counts roll as heading; here the switch is
    made where eq. 6.1 has lost its meaning in single precision. A vehicle on a floor never comes near.

    Parameters
    ----------
    qx, qy, qz, qw
        Components, broadcast against each other; need not be normalised (float32 streams are not).
    up
        Vertical axis of the stream: ``"y"`` (Motive's default, floor x, −z) or ``"z"`` (floor x, y).

    Returns
    -------
    Heading [rad] with the broadcast shape; NaN where the quaternion is not finite or zero (an untracked body).

    Raises
    ------
    InputError
        If `up` is neither ``"y"`` nor ``"z"``.

    Examples
    --------
    A quarter turn counter-clockwise, about y and about z:

    >>> float(np.degrees(quaternion_to_heading(0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)))).__round__(9)
    90.0
    >>> float(np.degrees(quaternion_to_heading(0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5), up="z"))).__round__(9)
    90.0
    """
    if up not in ("y", "z"):
        raise InputError("unknown vertical axis", where="up", value=repr(up), limit=OneOf("yz"))
    x, y, z, w = np.broadcast_arrays(*(np.asarray(q, dtype=np.float64) for q in (qx, qy, qz, qw)))
    quaternion = np.stack([x, y, z, w], axis=-1)
    heading = heading_of(quaternion, "x", "x", "-z" if up == "y" else "y", least_sine=_POLE_SINE)
    rise = x * y + z * w if up == "y" else x * z - y * w
    pitched = wrap_angle(np.copysign(2.0, rise) * np.arctan2(x, w))  # eq. 6.3 nose up, eq. 6.4 nose down
    norm = (quaternion**2).sum(axis=-1)
    usable = np.isfinite(norm) & (norm > 0.0)
    result: Floats = np.where(usable, np.where(np.isnan(heading), pitched, heading), np.nan)
    return result[()]


def heading_of(quaternion: Floats, forward: Axis, floor_x: Axis, floor_y: Axis, *, least_sine: float = 1e-3) -> Floats:
    """Return the heading [rad] of body axis `forward` on the floor, shape (…,): its projection.

    Parameters
    ----------
    quaternion
        Rotation from body to tracker axes, shape (…, 4), in the order x, y, z, w; any positive length.
    forward
        The body axis that points ahead.
    floor_x, floor_y
        The tracker axes that are the floor's x and y: (``"x"``, ``"-z"``) for a tracker with y up.
    least_sine
        Sine of the least angle between the axis and the vertical.

    Returns
    -------
    Floats
        NaN where the axis is nearer to the vertical, or the quaternion is zero or not finite.

    Examples
    --------
    >>> quarter_turn_about_y = np.array([[0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)]])
    >>> np.degrees(heading_of(quarter_turn_about_y, "x", "x", "-z")).round(6)
    array([90.])
    """
    vector, scalar = quaternion[..., :3], quaternion[..., 3:]
    axis = _unit(forward)
    # Rotation of a vector by a quaternion that need not have length one: q a q* = |q|² R a.
    turned = (
        (scalar**2 - (vector**2).sum(axis=-1, keepdims=True)) * axis
        + 2.0 * (vector @ axis)[..., None] * vector
        + 2.0 * scalar * np.cross(vector, axis)
    )
    ahead, left = turned @ _unit(floor_x), turned @ _unit(floor_y)
    defined = np.hypot(ahead, left) > least_sine * (quaternion**2).sum(axis=-1)
    return np.where(defined, wrap_angle(np.arctan2(left, ahead)), np.nan)


def floor_poses(
    position: Floats, quaternion: Floats, forward: Axis, floor_x: Axis, floor_y: Axis
) -> tuple[Floats, Floats, Floats]:
    """Return x, y [m] and heading [rad] on the floor, each of shape (n,), of poses in a tracker's axes.

    Parameters
    ----------
    position
        Positions in tracker axes [m], shape (n, 3).
    quaternion, forward, floor_x, floor_y
        As of `heading_of`, `quaternion` of shape (n, 4).

    Examples
    --------
    >>> x_m, y_m, heading_rad = floor_poses(
    ...     np.array([[1.0, 0.2, -3.0]]), np.array([[0.0, 0.0, 0.0, 1.0]]), "x", "x", "-z")
    >>> float(x_m[0]), float(y_m[0]), float(heading_rad[0])
    (1.0, 3.0, 0.0)
    """
    x_m, y_m = (position @ _unit(axis) for axis in (floor_x, floor_y))
    return np.asarray(x_m), np.asarray(y_m), heading_of(quaternion, forward, floor_x, floor_y)


def _unit(axis: Axis) -> Floats:
    unit = np.zeros(3)
    unit["xyz".index(axis[-1])] = -1.0 if axis.startswith("-") else 1.0
    return unit
