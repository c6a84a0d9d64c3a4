"""The identity messages: who answers behind a key, and what the runner can expect of it.

Bodies after the header: numbers first, then texts, then pairs of texts (header's count says how many).
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import cast

from agvbench.bus.messages.wire import MAX_TEXT_BYTES, Kind, Reader, pack_header, pack_text, unpack_header
from agvbench.errors import LinkError, MessageError
from agvbench.types import CommandUnit

_AGV = struct.Struct("<d??")
_MOCAP = struct.Struct("<d?")
_MAX_EXTRA = 64


@dataclass(frozen=True)
class AgvIdentity:
    """What an AGV adapter says of itself.

    ``neutral`` is the command at which nothing moves, in ``command_unit``; ``lock_step`` means that time passes
    only in exchanges; ``extra`` is for provenance (seed, plant, port, versions).
    """

    vehicle: str
    adapter: str
    firmware: str
    calibration_hash: str
    command_unit: CommandUnit
    neutral: float
    simulated: bool
    lock_step: bool
    extra: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class MocapIdentity:
    """What a mocap adapter says of itself; ``rate_hz`` [Hz] is how many frames it promises a second."""

    adapter: str
    rate_hz: float
    simulated: bool
    extra: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Identity:
    """Both adapters of a vehicle together: what a runner asks for before it drives."""

    vehicle: str
    firmware: str
    calibration_hash: str
    command_unit: CommandUnit
    neutral: float
    simulated: bool
    lock_step: bool
    mocap_rate_hz: float
    agv: AgvIdentity
    mocap: MocapIdentity

    @classmethod
    def of(cls, agv: AgvIdentity, mocap: MocapIdentity) -> Identity:
        """Return the identity of a vehicle that `agv` drives and `mocap` sees.

        Raises
        ------
        LinkError
            If one is simulated and the other is not.
        """
        if agv.simulated != mocap.simulated:
            what = "simulated {} and a real {} cannot work together"
            names = ("vehicle", "motion capture system")
            raise LinkError(
                "a " + what.format(*(names if agv.simulated else names[::-1])),
                where=agv.vehicle,
                value=f"agv {agv.adapter}, mocap {mocap.adapter}",
                remedy="simulate both or neither",
            )
        return cls(
            vehicle=agv.vehicle,
            firmware=agv.firmware,
            calibration_hash=agv.calibration_hash,
            command_unit=agv.command_unit,
            neutral=agv.neutral,
            simulated=agv.simulated,
            lock_step=agv.lock_step,
            mocap_rate_hz=mocap.rate_hz,
            agv=agv,
            mocap=mocap,
        )


def encode_agv_identity(identity: AgvIdentity) -> bytes:
    """Return the identity's bytes."""
    texts = (identity.vehicle, identity.adapter, identity.firmware, identity.calibration_hash, identity.command_unit)
    return b"".join(
        (
            pack_header(Kind.AGV_IDENTITY, count=len(identity.extra)),
            _AGV.pack(identity.neutral, identity.simulated, identity.lock_step),
            *map(pack_text, texts),
            _pack_extra(identity.extra),
        )
    )


def decode_agv_identity(payload: bytes) -> AgvIdentity:
    """Return the identity that `payload` holds.

    Raises
    ------
    MessageError
        If it is not an identity of an AGV that this version writes.
    """
    header = unpack_header(payload, Kind.AGV_IDENTITY)
    reader = Reader(payload)
    neutral, simulated, lock_step = reader.fields(_AGV)
    vehicle, adapter, firmware, calibration_hash, unit = (reader.text() for _ in range(5))
    extra = _read_extra(reader, header.rows)
    if unit not in ("us", "normalised"):
        raise MessageError("unknown command unit", value=repr(unit), limit="us or normalised")
    return AgvIdentity(
        vehicle,
        adapter,
        firmware,
        calibration_hash,
        cast(CommandUnit, unit),
        neutral,
        simulated,
        lock_step,
        extra,
    )


def encode_mocap_identity(identity: MocapIdentity) -> bytes:
    """Return the identity's bytes."""
    header = pack_header(Kind.MOCAP_IDENTITY, count=len(identity.extra))
    numbers = _MOCAP.pack(identity.rate_hz, identity.simulated)
    return header + numbers + pack_text(identity.adapter) + _pack_extra(identity.extra)


def decode_mocap_identity(payload: bytes) -> MocapIdentity:
    """Return the identity that `payload` holds.

    Raises
    ------
    MessageError
        If it is not an identity of a motion capture system that this version writes.
    """
    header = unpack_header(payload, Kind.MOCAP_IDENTITY)
    reader = Reader(payload)
    rate_hz, simulated = reader.fields(_MOCAP)
    adapter = reader.text()
    extra = _read_extra(reader, header.rows)
    if not 0.0 < rate_hz < float("inf"):
        raise MessageError("frame rate is out of range", value=f"{rate_hz} Hz", limit="above 0 Hz")
    return MocapIdentity(adapter, rate_hz, simulated, extra)


def _pack_extra(extra: Mapping[str, str]) -> bytes:
    if len(extra) > _MAX_EXTRA:
        raise MessageError("identity has too many extra texts", value=len(extra), limit=f"at most {_MAX_EXTRA}")
    return b"".join(pack_text(text[:MAX_TEXT_BYTES]) for pair in extra.items() for text in pair)


def _read_extra(reader: Reader, count: int) -> dict[str, str]:
    if count > _MAX_EXTRA:
        raise MessageError("identity has too many extra texts", value=count, limit=f"at most {_MAX_EXTRA}")
    extra = {reader.text(): reader.text() for _ in range(count)}
    reader.finish()
    return extra
