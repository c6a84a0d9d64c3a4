"""The truth message: true poses, from a simulated vehicle to a simulated camera. Nobody else may listen.

Body after the header: acknowledged (u64), ``end_s`` (f64), then columns ``t_s``, ``x_m``, ``y_m``,
``heading_rad`` (f64).
"""

from __future__ import annotations

import struct
from typing import Final, NamedTuple

import numpy as np

from agvbench.bus.messages.wire import FLOAT, MAX_ROWS, Kind, Reader, pack_column, pack_header, unpack_header
from agvbench.errors import MessageError
from agvbench.types import Floats

_BODY = struct.Struct("<Qd")


class TruthFlags:
    """What the camera should do with the poses; bits as plain integers."""

    NONE: Final = 0
    LAST: Final = 1
    """The exchange is complete: answer it."""
    FLUSH: Final = 2
    """Let go of every frame that is still under way."""
    LIVE: Final = 4
    """Times are in the clock that all adapters of this machine share, not in the run's."""


_KNOWN = TruthFlags.LAST | TruthFlags.FLUSH | TruthFlags.LIVE


class Truth(NamedTuple):
    """True poses, shape (n, 3), at the camera's instants `t_s`, shape (n,), up to ``end_s`` [s] in the run's clock."""

    sequence: int
    acknowledged: int
    end_s: float
    t_s: Floats
    poses: Floats
    flags: int = TruthFlags.LAST
    source: int = 0


def encode_truth(truth: Truth) -> bytes:
    """Return the message's bytes, or raise `MessageError` if there are more poses than fit."""
    count = len(truth.t_s)
    if count > MAX_ROWS:
        raise MessageError("too many poses for one message", value=count, limit=f"at most {MAX_ROWS}")
    return b"".join(
        (
            pack_header(Kind.TRUTH, flags=truth.flags, source=truth.source, count=count, sequence=truth.sequence),
            _BODY.pack(truth.acknowledged, truth.end_s),
            pack_column(truth.t_s, FLOAT),
            pack_column(truth.poses.T, FLOAT),
        )
    )


def decode_truth(payload: bytes) -> Truth:
    """Return the message that `payload` holds, or raise `MessageError`."""
    header = unpack_header(payload, Kind.TRUTH, _KNOWN)
    reader = Reader(payload)
    acknowledged, end_s = reader.fields(_BODY)
    t_s = reader.column(header.rows, FLOAT)
    poses = reader.column(3 * header.rows, FLOAT).reshape(3, header.rows).T
    reader.finish()
    if not (np.isfinite(t_s).all() and np.isfinite(poses).all() and np.isfinite(end_s)):
        raise MessageError("true poses are not finite")
    return Truth(header.sequence, acknowledged, end_s, t_s, poses, header.flags, header.source)
