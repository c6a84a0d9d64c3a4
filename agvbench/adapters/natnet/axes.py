"""The server's axes and the floor's: y up, as Motive streams by default (floor x = x, y = −z, thesis 6.1), or z up."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from agvbench.adapters.natnet.protocol.bitstream import BODY, TRACKED
from agvbench.types import Floats, Frames
from agvbench.vehicle.quaternion import Up, quaternion_to_heading


def to_floor(position_m: NDArray[np.float32], quaternion: NDArray[np.float32], up: Up) -> Floats:
    """Return poses (n, 3) [m, m, rad] on the floor of positions (n, 3) [m] and quaternions (n, 4) (x, y, z, w)."""
    poses = np.empty((len(position_m), 3))
    poses[:, 0] = position_m[:, 0]
    poses[:, 1] = -position_m[:, 2].astype(np.float64) if up == "y" else position_m[:, 1]
    poses[:, 2] = quaternion_to_heading(*quaternion.T, up=up)
    return poses


def from_floor(poses: Floats, up: Up, height_m: float = 0.0) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return positions (n, 3) [m] and quaternions (n, 4) of level bodies at `poses` (n, 3) on the floor.

    >>> import numpy as np
    >>> there = np.array([[1.0, 2.0, 0.5]])
    >>> [bool(np.allclose(to_floor(*from_floor(there, up), up), there)) for up in ("y", "z")]
    [True, True]
    """
    count = len(poses)
    position, quaternion = np.full((count, 3), height_m, np.float32), np.zeros((count, 4), np.float32)
    position[:, 0] = poses[:, 0]
    position[:, 2 if up == "y" else 1] = -poses[:, 1] if up == "y" else poses[:, 1]
    quaternion[:, 1 if up == "y" else 2] = np.sin(poses[:, 2] / 2.0)
    quaternion[:, 3] = np.cos(poses[:, 2] / 2.0)
    return position, quaternion


def bodies_of(frames: Frames, body: int, height_m: float = 0.1) -> NDArray[Any]:
    """Return the records (n,) of a rigid body, y up, that a server streams of what a simulated camera saw."""
    bodies = np.zeros(len(frames), BODY)
    bodies["id"], bodies["flags"], bodies["mean_error_m"] = body, TRACKED * frames.tracked, frames.mean_error_m
    poses = np.column_stack([frames.x_m, frames.y_m, frames.heading_rad])
    bodies["position_m"], bodies["quaternion"] = from_floor(poses, "y", height_m)
    return bodies
