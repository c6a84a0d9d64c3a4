"""``fails``: the adapter raises an unexpected exception."""

from __future__ import annotations

from agvbench.adapters.impairment.faults import SerialLine, VehicleFault


class Fails(VehicleFault):
    """A mistake in an adapter."""

    name = "fails"

    def inject(self, line: SerialLine | None) -> None:
        """Raise."""
        raise RuntimeError("impaired on purpose")
