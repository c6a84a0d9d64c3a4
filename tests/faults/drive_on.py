"""A runner that drives straight on for half a minute: to be killed."""

import sys

from agvbench.adapters import open_rig
from agvbench.types import Command

with open_rig(connect=sys.argv[1:]) as link:
    for second in range(30):
        link.control_cycle(Command(1700.0, 1500.0, 1500.0), t_s=float(second), hold_s=1.0)
        if not second:
            print("driving", flush=True)
