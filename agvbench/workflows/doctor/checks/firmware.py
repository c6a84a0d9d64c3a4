"""Whether the firmware can be run in a simulated microcontroller."""

from __future__ import annotations

from agvbench.adapters.registry import parse_spec
from agvbench.adapters.simavr.address import FirmwareAddress
from agvbench.adapters.simavr.firmware_files import missing_packages, why_not_built
from agvbench.workflows.doctor.finding import Check, Finding, FindingState, Lab

_SCHEMES = ("simavr", "simavr-live")


class FirmwareCheck(Check):
    """Looks for the compiler, simavr, and what they have built."""

    name = "firmware"

    def examine(self, lab: Lab) -> Finding:
        """Fail only where ``simavr`` is asked for."""
        scheme, address = parse_spec(lab.settings.agv)
        asked = scheme in _SCHEMES
        why = why_not_built(FirmwareAddress.parse(address, where=scheme).version) if asked else why_not_built()
        if not why:
            return Finding(FindingState.GOOD, "built, and can be simulated: --agv simavr")
        if asked:
            return Finding(FindingState.BAD, why)
        missing = missing_packages()
        if not missing:
            return Finding(FindingState.IDLE, "simulated firmware: not built", "for --agv simavr: agvbench firmware")
        lacks = " ".join(missing)
        remedy = f"for --agv simavr: apt-get install {lacks}, then agvbench firmware"
        return Finding(FindingState.IDLE, f"simulated firmware: without {lacks}", remedy)
