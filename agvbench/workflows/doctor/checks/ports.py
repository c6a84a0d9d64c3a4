"""Whether the vehicle's serial port is there, and may be used."""

from __future__ import annotations

import os
from pathlib import Path

from agvbench.adapters.registry import parse_spec
from agvbench.workflows.doctor.finding import Check, Finding, FindingState, Lab


class PortsCheck(Check):
    """Lists serial ports, and looks at the one asked for; that the vehicle answers there is asked by `Adapters`."""

    name = "serial ports"

    def examine(self, lab: Lab) -> Finding:
        """Look at existence and permissions."""
        from serial.tools.list_ports import comports

        there = " ".join(sorted(port.device for port in comports())) or "none"
        scheme, address = parse_spec(lab.settings.agv)
        if scheme != "serial":
            return Finding(FindingState.IDLE, f"there are: {there}", "give the vehicle: --agv serial:PORT")
        if not address or not Path(address).exists():
            return Finding(
                FindingState.BAD, f"no port {address!r} (there are: {there})", "plug the vehicle in, name its port"
            )
        if not os.access(address, os.R_OK | os.W_OK):
            return Finding(
                FindingState.BAD, f"{address} may not be used by you", "join the group dialout, log in again"
            )
        return Finding(FindingState.GOOD, f"{address} is there and may be used")
