"""Whether the firmware can be run in a simulated microcontroller."""

from __future__ import annotations

from agvbench.adapters.registry import parse_spec
from agvbench.adapters.simavr.built import missing_packages, why_not_built
from agvbench.workflows.doctor.finding import Check, Finding, Lab, State


class Firmware(Check):
    """Looks for the compiler, simavr, and what they have built."""

    name = "firmware"

    def examine(self, lab: Lab) -> Finding:
        """Fail only where ``simavr`` is asked for."""
        scheme, version = parse_spec(lab.agv)
        why = why_not_built(version or "2") if scheme == "simavr" else why_not_built()
        if not why:
            return Finding(State.GOOD, "built, and can be simulated: --agv simavr")
        if scheme == "simavr":
            return Finding(State.BAD, why)
        missing = missing_packages()
        lacks = f"without {' '.join(missing)}" if missing else "not built"
        return Finding(State.IDLE, f"simulated firmware: {lacks}", "for --agv simavr: nox -s firmware")
