"""Requests to adapters that are not commands, and their replies: claim, reset, sampling, replay, time.

Bodies after the header: claim has none, its runner is the header's source; reset is a pose and a sampling (5 f64) and
the run key; sampling is rate and phase (2 f64); replay is a reset, ``until_s`` (f64), and columns ``t_s``, ``drive``,
``front``, ``rear``; time is one f64.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

import numpy as np

from agvbench.bus.messages.wire import (
    FLOAT,
    HEADER_BYTES,
    MAX_ROWS,
    Header,
    Kind,
    Reader,
    check_length,
    pack_column,
    pack_header,
    pack_text,
    unpack_header,
)
from agvbench.errors import MessageError
from agvbench.types import Commands, Pose

_RESET = struct.Struct("<5d")
_SAMPLING = struct.Struct("<2d")
_NUMBER = struct.Struct("<d")


@dataclass(frozen=True)
class Sampling:
    """When a camera looks: at ``phase_s + k / rate_hz`` [s] in the run's clock, for every integer k."""

    rate_hz: float
    phase_s: float


@dataclass(frozen=True)
class Reset:
    """Place a simulated vehicle at rest at `pose`; ``run_key`` seeds all that is random in the run to come.

    Commands from ``source`` up to number ``after`` belong to what was before: a host that finds one still waiting
    drops it.
    """

    run_key: str
    pose: Pose
    sampling: Sampling
    source: int = 0
    after: int = 0


@dataclass(frozen=True)
class Replay:
    """Drive a recorded run again, without frames, until ``until_s`` [s] in its clock."""

    reset: Reset
    commands: Commands
    until_s: float


def encode_claim(source: int) -> bytes:
    """Return the bytes by which the runner whose commands are of `source` claims a vehicle, or releases it."""
    return pack_header(Kind.CLAIM, count=1, source=source)


def decode_claim(payload: bytes) -> int:
    """Return the source of the runner that claims or releases the vehicle, or raise `MessageError`."""
    header = unpack_header(payload, Kind.CLAIM)
    check_length(payload, HEADER_BYTES)
    return header.source


def encode_sampling(sampling: Sampling) -> bytes:
    """Return the sampling's bytes."""
    return pack_header(Kind.SAMPLING, count=1) + _SAMPLING.pack(sampling.rate_hz, sampling.phase_s)


def decode_sampling(payload: bytes) -> Sampling:
    """Return the sampling that `payload` holds, or raise `MessageError`."""
    unpack_header(payload, Kind.SAMPLING)
    reader = Reader(payload)
    sampling = _sampling(*reader.fields(_SAMPLING))
    reader.finish()
    return sampling


def encode_reset(reset: Reset) -> bytes:
    """Return the request's bytes."""
    return pack_header(Kind.RESET, count=1, source=reset.source, sequence=reset.after) + _pack_reset(reset)


def decode_reset(payload: bytes) -> Reset:
    """Return the request that `payload` holds, or raise `MessageError`."""
    header = unpack_header(payload, Kind.RESET)
    reader = Reader(payload)
    reset = _read_reset(reader, header)
    reader.finish()
    return reset


def encode_replay(replay: Replay) -> bytes:
    """Return the request's bytes, or raise `MessageError` if there are more commands than fit."""
    commands = replay.commands
    if len(commands) > MAX_ROWS:
        raise MessageError("too many commands to replay", value=len(commands), limit=f"at most {MAX_ROWS}")
    columns = (commands.t_s, commands.drive, commands.front, commands.rear)
    return b"".join(
        (
            pack_header(Kind.REPLAY, count=len(commands), source=replay.reset.source, sequence=replay.reset.after),
            _pack_reset(replay.reset),
            _NUMBER.pack(replay.until_s),
            *(pack_column(column, FLOAT) for column in columns),
        )
    )


def decode_replay(payload: bytes) -> Replay:
    """Return the request that `payload` holds, or raise `MessageError`."""
    header = unpack_header(payload, Kind.REPLAY)
    reader = Reader(payload)
    reset = _read_reset(reader, header)
    (until_s,) = reader.fields(_NUMBER)
    columns = reader.column(4 * header.rows, FLOAT).reshape(4, header.rows)
    reader.finish()
    if not (math.isfinite(until_s) and np.isfinite(columns).all()):
        raise MessageError("commands to replay are not finite", where=reset.run_key)
    if (np.diff(columns[0]) <= 0.0).any():
        raise MessageError("commands to replay go back in time", where=reset.run_key)
    return Replay(reset, Commands(*columns), until_s)


def encode_time(now_s: float) -> bytes:
    """Return a clock's reading as bytes."""
    return pack_header(Kind.TIME, count=1) + _NUMBER.pack(now_s)


def decode_time(payload: bytes) -> float:
    """Return the clock's reading [s] that `payload` holds, or raise `MessageError`."""
    unpack_header(payload, Kind.TIME)
    reader = Reader(payload)
    (now_s,) = reader.fields(_NUMBER)
    reader.finish()
    if not math.isfinite(now_s):
        raise MessageError("time is not finite", value=now_s)
    return float(now_s)


def _pack_reset(reset: Reset) -> bytes:
    return _RESET.pack(*reset.pose, reset.sampling.rate_hz, reset.sampling.phase_s) + pack_text(reset.run_key)


def _read_reset(reader: Reader, header: Header) -> Reset:
    x_m, y_m, heading_rad, rate_hz, phase_s = reader.fields(_RESET)
    run_key = reader.text()
    pose = Pose(x_m, y_m, heading_rad)
    if not pose.is_finite:
        raise MessageError("pose to reset to is not finite", where=run_key, value=tuple(pose))
    return Reset(run_key, pose, _sampling(rate_hz, phase_s), header.source, header.sequence)


def _sampling(rate_hz: float, phase_s: float) -> Sampling:
    if not (0.0 < rate_hz < math.inf and math.isfinite(phase_s)):
        raise MessageError("sampling is out of range", value=f"{rate_hz} Hz, {phase_s} s", limit="above 0 Hz, finite")
    return Sampling(rate_hz, phase_s)
