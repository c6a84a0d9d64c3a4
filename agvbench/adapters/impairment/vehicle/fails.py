"""``fails``: the adapter raises what nobody thought of."""

from __future__ import annotations

from agvbench.adapters.impairment.faults import Line, VehicleFault


class Fails(VehicleFault):
    """A mistake in an adapter."""

    name = "fails"

    def strike(self, line: Line | None) -> None:
        """Raise."""
        raise RuntimeError("impaired on purpose")
