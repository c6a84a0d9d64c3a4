"""Whether processes of this machine can talk over the bus."""

from __future__ import annotations

from agvbench.bus.session import open_session
from agvbench.workflows.doctor.finding import Check, Finding, Lab, State


class Bus(Check):
    """Opens a session that nobody else can reach."""

    name = "bus"

    def examine(self, lab: Lab) -> Finding:
        """Open and close it."""
        with open_session():
            return Finding(State.GOOD, "Zenoh opens a session on this machine")
