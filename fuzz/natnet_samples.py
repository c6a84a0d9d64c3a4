"""Packets as a server streams them, for the targets that take NatNet."""

from __future__ import annotations

import struct
from collections.abc import Iterator

import numpy as np

VERSIONS = ((2, 5), (2, 6), (2, 7), (2, 9), (2, 11), (3, 0), (3, 1), (4, 0), (4, 1), (4, 2))


def packets(version: tuple[int, int]) -> Iterator[bytes]:
    """Give a server's packets: its identity, what bodies are called, a frame with markers, an echo, a text."""
    from agvbench.adapters.natnet.protocol.bitstream import BODY, MARKER, Version
    from agvbench.adapters.natnet.protocol.encode import Model, encode_descriptions, encode_frame
    from agvbench.adapters.natnet.protocol.frame import FrameOfData
    from agvbench.adapters.natnet.protocol.packet import Message, join
    from agvbench.adapters.natnet.protocol.server_info import ServerInfo, encode_server_info

    spoken = Version(*version)
    bodies, markers = np.zeros(2, BODY), np.zeros(3, MARKER)
    bodies["id"], bodies["flags"], bodies["quaternion"] = (1, 2), (1, 0), (0.0, 0.0, 0.0, 1.0)
    markers["id"] = (1 << 16) + np.arange(1, 4)
    models = [Model(1, "agv1", np.zeros((3, 3), np.float32)), Model(2, "agv2")]
    yield join(Message.SERVERINFO, encode_server_info(ServerInfo("Motive", "3.0.1.1", spoken, 10_000_000, 1511)))
    yield join(Message.MODELDEF, encode_descriptions(models, spoken))
    yield join(
        Message.FRAMEOFDATA, encode_frame(FrameOfData(1, bodies, markers, 1.0, 100, 200, 300, 0), spoken, models)
    )
    yield join(Message.ECHO_RESPONSE, struct.pack("<QQ", 1_000_000, 20_000_000))
    yield join(Message.RESPONSE, struct.pack("<f", 240.0))
    yield join(Message.REQUEST, f"Bitstream,{spoken}\0".encode())
