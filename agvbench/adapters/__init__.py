"""What stands between the bus and a vehicle or a motion capture system.

Everything that an author of adapters needs is here: the two base classes, what their methods get and return, and the
error that they raise.
"""

from agvbench.adapters.contract import AdapterOptions, AgvAdapter, AgvReports, MocapAdapter, MocapReports
from agvbench.adapters.node import host_adapters
from agvbench.adapters.registry import check_specs
from agvbench.adapters.rig import open_rig
from agvbench.bus.messages.command import CommandFlags, CommandMessage
from agvbench.bus.messages.event import Level
from agvbench.bus.messages.frames import FrameClock
from agvbench.bus.messages.identity import AgvIdentity, MocapIdentity
from agvbench.bus.messages.request import Replay, Reset, Sampling
from agvbench.bus.messages.truth import Truth, TruthFlags
from agvbench.errors import LinkError
from agvbench.types import Command, Commands, Frames, Pose

__all__ = [
    "AdapterOptions",
    "AgvAdapter",
    "AgvIdentity",
    "AgvReports",
    "Command",
    "CommandFlags",
    "CommandMessage",
    "Commands",
    "FrameClock",
    "Frames",
    "Level",
    "LinkError",
    "MocapAdapter",
    "MocapIdentity",
    "MocapReports",
    "Pose",
    "Replay",
    "Reset",
    "Sampling",
    "Truth",
    "TruthFlags",
    "check_specs",
    "host_adapters",
    "open_rig",
]
