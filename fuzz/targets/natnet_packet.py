"""NatNet packets in every version, as a client and ``mocap --decode`` read them; the first byte chooses the version."""

from __future__ import annotations

import json
from collections.abc import Iterable

from fuzz.natnet_samples import VERSIONS, packets
from fuzz.target import Target


class NatNetPacket(Target):
    """A version and a packet."""

    name = "natnet_packet"
    instruments = ("agvbench.adapters.natnet",)

    def __init__(self) -> None:
        from agvbench.adapters.natnet.protocol.bitstream import Version
        from agvbench.adapters.natnet.protocol.frame import decode_frame
        from agvbench.adapters.natnet.protocol.packet import Message, split
        from agvbench.adapters.natnet.transcript import Transcript

        self._transcript, self._split, self._decode, self._frame = Transcript, split, decode_frame, Message.FRAMEOFDATA
        self._versions = [Version(*version) for version in VERSIONS]

    def seeds(self) -> Iterable[bytes]:
        """Return packets of each kind in each version."""
        for index, version in enumerate(VERSIONS):
            for packet in packets(version):
                yield bytes([index]) + packet

    def feed(self, data: bytes) -> None:
        """Decode a packet to JSON, and with its markers."""
        version, packet = self._versions[data[0] % len(self._versions) if data else 0], data[1:]
        json.dumps(self._transcript(version).decode(packet), allow_nan=False)
        message, payload = self._split(packet)
        if message == self._frame:
            self._decode(payload, version, markers=True)
