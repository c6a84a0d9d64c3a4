"""``faster=FACTOR``: the drive is commanded that much more than it should be."""

from __future__ import annotations

from agvbench.adapters.impairment.faults import VehicleFault
from agvbench.types import Command


class Faster(VehicleFault):
    """A speed controller that was exchanged, or set up anew: neutral is still neutral."""

    name = "faster"
    default = 1.5
    highest = 10.0

    def alter(self, command: Command, neutral: Command) -> Command:
        """Take the drive further from neutral."""
        return command._replace(drive=neutral.drive + self.value * (command.drive - neutral.drive))
