"""``unplugged``: the serial port is gone."""

from __future__ import annotations

from agvbench.adapters.impairment.faults import SerialLine, VehicleFault


class Unplugged(VehicleFault):
    """A cable that was pulled out."""

    name = "unplugged"
    needs_line = True

    def inject(self, line: SerialLine | None) -> None:
        """Pull it."""
        assert line is not None  # noqa: S101  (the adapter was asked)
        line.pull()
