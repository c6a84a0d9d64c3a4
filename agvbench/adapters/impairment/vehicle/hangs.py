"""``hangs=SECONDS``: the adapter does not come back from a command, for so long."""

from __future__ import annotations

import threading

from agvbench.adapters.impairment.faults import SerialLine, VehicleFault


class Hangs(VehicleFault):
    """A driver that waits for what does not come."""

    name = "hangs"
    default = highest = 3600.0

    def __init__(self, value: float | None = None) -> None:
        super().__init__(value)
        self._ceased = threading.Event()

    def inject(self, line: SerialLine | None) -> None:
        """Wait, in real time, for an adapter hangs in real time."""
        self._ceased.wait(self.value)

    def release(self) -> None:
        """Let go."""
        self._ceased.set()
