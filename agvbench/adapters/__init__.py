"""What stands between the bus and a vehicle or a motion capture system."""

from agvbench.adapters.contract import AdapterOptions, AgvAdapter, MocapAdapter
from agvbench.adapters.node import host_adapters
from agvbench.adapters.rig import open_rig

__all__ = ["AdapterOptions", "AgvAdapter", "MocapAdapter", "host_adapters", "open_rig"]
