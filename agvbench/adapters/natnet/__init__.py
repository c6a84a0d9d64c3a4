"""NatNet, the protocol that OptiTrack's Motive streams in: packets, a client, and an emulated server."""

from agvbench.adapters.natnet.capture import datagrams_of
from agvbench.adapters.natnet.protocol.bitstream import Version
from agvbench.adapters.natnet.protocol.description import BodyDescription, decode_descriptions
from agvbench.adapters.natnet.protocol.frame import FrameOfData, decode_frame
from agvbench.adapters.natnet.protocol.packet import Message, split
from agvbench.adapters.natnet.protocol.server_info import ServerInfo, decode_server_info

__all__ = [
    "BodyDescription",
    "FrameOfData",
    "Message",
    "ServerInfo",
    "Version",
    "datagrams_of",
    "decode_descriptions",
    "decode_frame",
    "decode_server_info",
    "split",
]
