"""The truth message: true poses, from a simulated vehicle to a simulated camera. No other role may subscribe."""

from __future__ import annotations

from typing import Annotated, Final

import numpy as np
from msgspec import Meta
from msgspec.structs import replace

from agvbench.bus.messages.codec import MAX_ROWS, Message, Number, Source, decoder
from agvbench.errors import MessageError
from agvbench.types import Floats


class TruthFlags:
    """What the camera should do with the poses; bits as plain integers."""

    NONE: Final = 0
    LAST: Final = 1
    """The exchange is complete: answer it."""
    FLUSH: Final = 2
    """Let go of every frame that is still under way."""
    LIVE: Final = 4
    """Times are in the clock that all adapters of this machine share, not in the run's."""


class Truth(Message, tag="truth", frozen=True):
    """True poses, shape (n, 3), at the camera's instants `t_s`, shape (n,), up to ``end_s`` [s] in the run's clock."""

    sequence: Number
    acknowledged: Number
    end_s: float
    t_s: Floats
    poses: Floats
    flags: Annotated[int, Meta(ge=0, le=7)] = TruthFlags.LAST
    source: Source = 0


_decode = decoder(Truth)


def decode_truth(payload: bytes) -> Truth:
    """Return the message that `payload` holds, or raise `MessageError`."""
    truth = _decode(payload)
    count = len(truth.t_s)
    if count > MAX_ROWS:
        raise MessageError("too many poses for one message", value=count, limit=f"at most {MAX_ROWS}")
    if truth.poses.size != 3 * count:
        raise MessageError("poses do not fit their times", value=f"{truth.poses.size} numbers", limit=f"3 × {count}")
    if not (np.isfinite(truth.t_s).all() and np.isfinite(truth.poses).all() and np.isfinite(truth.end_s)):
        raise MessageError("true poses are not finite")
    return replace(truth, poses=truth.poses.reshape(count, 3))
