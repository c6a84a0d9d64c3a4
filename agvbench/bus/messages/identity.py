"""The identity messages: which adapter answers behind a key, and what the runner can expect of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta, field

from agvbench.bus.messages.codec import Message, Text, decoder
from agvbench.errors import LinkError, MessageError, VehicleError
from agvbench.vehicle.channels import Channels

_Extra = Annotated[dict[Text, Text], Meta(max_length=64)]


class AgvIdentity(Message, tag="agv_identity", frozen=True):
    """What an AGV adapter says of itself.

    ``channels`` are the units, neutral commands and ranges of its command channels; ``lock_step`` means that time
    passes only in exchanges; ``extra`` is for provenance (seed, plant, port, versions).
    """

    vehicle: Text
    adapter: Text
    firmware: Text
    calibration_hash: Text
    channels: Channels
    simulated: bool
    lock_step: bool
    extra: _Extra = field(default_factory=dict)


class MocapIdentity(Message, tag="mocap_identity", frozen=True):
    """What a mocap adapter says of itself; ``rate_hz`` [Hz] is its nominal frame rate."""

    adapter: Text
    rate_hz: float
    simulated: bool
    extra: _Extra = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 0.0 < self.rate_hz < math.inf:
            raise MessageError("frame rate is out of range", value=f"{self.rate_hz} Hz", limit="above 0 Hz")


@dataclass(frozen=True)
class Identity:
    """Both adapters of a vehicle together: what a runner asks for before it drives."""

    vehicle: str
    firmware: str
    calibration_hash: str
    channels: Channels
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
            channels=agv.channels,
            simulated=agv.simulated,
            lock_step=agv.lock_step,
            mocap_rate_hz=mocap.rate_hz,
            agv=agv,
            mocap=mocap,
        )


_decode_agv_identity = decoder(AgvIdentity)


def decode_agv_identity(payload: bytes) -> AgvIdentity:
    """Return the identity, or raise `MessageError`."""
    try:
        return _decode_agv_identity(payload)
    except VehicleError as error:  # a channel that cannot be
        raise MessageError(error.what, where=f"channels: {error.where}", value=error.value, limit=error.limit) from None


decode_mocap_identity = decoder(MocapIdentity)
