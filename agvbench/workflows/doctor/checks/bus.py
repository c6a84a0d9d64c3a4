"""Whether processes of this machine can talk over the bus."""

from __future__ import annotations

from agvbench.bus.session import open_bus_session
from agvbench.workflows.doctor.finding import Check, Finding, FindingState, Lab


class BusCheck(Check):
    """Opens a session that no other process can reach."""

    name = "bus"

    def examine(self, lab: Lab) -> Finding:
        """Open and close it."""
        with open_bus_session():
            return Finding(FindingState.GOOD, "Zenoh opens a session on this machine")
