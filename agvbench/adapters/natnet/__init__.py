"""NatNet, the protocol that OptiTrack's Motive streams in: packets, a client, and an emulated server."""

from agvbench.adapters.natnet.capture import datagrams_of
from agvbench.adapters.natnet.description import BodyDescription, decode_descriptions
from agvbench.adapters.natnet.frame import FrameOfData, decode_frame
from agvbench.adapters.natnet.packet import Message, split
from agvbench.adapters.natnet.server import ServerInfo, decode_server_info
from agvbench.adapters.natnet.version import Version

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
