"""Detect frames in which a tracker jumped: to a wrong marker, to another object, or by a flipped fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agvbench.campaign.recordings.mapping import Gate
from agvbench.errors import InputError
from agvbench.signals import best_chain
from agvbench.types import Floats, wrap_angle

Indices = NDArray[np.int64]

_STEP_S = 0.25
_MOST_PIECES = 20_000
_FRAME_WORTH_M = 1e-9  # decides between chains that drive equally far: a vehicle that stands still


def jumped(t_s: Floats, x_m: Floats, y_m: Floats, heading_rad: Floats, gate: Gate) -> NDArray[np.bool_]:
    """Return which frames are not the vehicle's; every array has shape (n,) and all values are finite.

    The track is cut wherever the vehicle cannot have moved as far as two neighbouring frames say. Of the pieces,
    the chain that the vehicle can have driven through and that drives farthest is the vehicle's. Comparing with the
    last good frame alone would, once its reach has grown, follow another object that the tracker holds for seconds;
    and counting frames would prefer such an object if it held it longer than the vehicle.

    Parameters
    ----------
    t_s
        Capture time [s], not decreasing.
    x_m, y_m, heading_rad
        Poses [m, m, rad] in the floor frame.
    gate
        The largest speed and yaw rate, and the slack that noise needs.

    Raises
    ------
    InputError
        If it cuts the track into more pieces than can be joined in reasonable time: a wrong unit, as a rule.
    """
    if len(t_s) == 0:
        return np.zeros(0, np.bool_)
    poses = np.column_stack((t_s, x_m, y_m, heading_rad))
    first = np.flatnonzero(np.r_[True, ~_reachable(poses[:-1], poses[1:], gate)])
    if len(first) > _MOST_PIECES:
        raise InputError(
            "the gate finds a jump nearly everywhere", where="[gate]", value=f"{len(first) - 1} in {len(t_s)} frames",
            limit=f"at most {_MOST_PIECES - 1}", remedy="check max_speed, max_yaw_rate and the units of the columns",
        )  # fmt: skip
    last = np.r_[first[1:], len(t_s)] - 1
    score = _driven(poses, first, last, gate.slack_m) + _FRAME_WORTH_M * (last - first + 1)
    starts, ends = poses[first], poses[last]
    chain = best_chain(score, lambda before, piece: _reachable(ends[before], starts[piece][None], gate), _MOST_PIECES)
    stranger = np.ones(len(first), np.bool_)
    stranger[chain] = False
    return np.repeat(stranger, last - first + 1)


def _driven(poses: Floats, first: Indices, last: Indices, slack_m: float) -> Floats:
    """Return how far each piece drives [m], in steps long enough to drown noise."""
    step = np.floor(poses[:, 0] / _STEP_S)
    corner = np.r_[True, np.diff(step) > 0.0]
    corner[first] = corner[last] = True
    rows = np.flatnonzero(corner)
    distance = np.hypot(*np.diff(poses[rows, 1:3], axis=0).T)
    piece = np.searchsorted(first, rows, side="right") - 1
    inside = np.diff(piece) == 0
    lengths = np.maximum(distance[inside] - slack_m, 0.0)
    return np.bincount(piece[1:][inside], weights=lengths, minlength=len(first)).astype(np.float64)


def _reachable(before: Floats, after: Floats, gate: Gate) -> NDArray[np.bool_]:
    elapsed = after[:, 0] - before[:, 0]
    distance = np.hypot(after[:, 1] - before[:, 1], after[:, 2] - before[:, 2])
    turn = np.abs(wrap_angle(after[:, 3] - before[:, 3]))
    near = distance <= gate.max_speed_m_per_s * elapsed + gate.slack_m
    return near & (turn <= gate.max_yaw_rate_rad_per_s * elapsed + gate.slack_rad)
