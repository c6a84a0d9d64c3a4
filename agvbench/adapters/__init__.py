"""What stands between the bus and a vehicle or a motion capture system."""

from agvbench.adapters.contract import AdapterOptions, AgvAdapter, MocapAdapter
from agvbench.adapters.node import host_adapters
from agvbench.adapters.registry import check_specs
from agvbench.adapters.rig import open_rig

__all__ = ["AdapterOptions", "AgvAdapter", "MocapAdapter", "check_specs", "host_adapters", "open_rig"]
