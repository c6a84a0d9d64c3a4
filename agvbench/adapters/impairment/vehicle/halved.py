"""``halved=SHARE``: that share of the lines arrives without its second half."""

from __future__ import annotations

from agvbench.adapters.impairment.fault import Line, VehicleFault


class Halved(VehicleFault):
    """A buffer that overflows: what is left of a line runs into the next."""

    name = "halved"
    usual = 0.1
    needs_line = True

    def strike(self, line: Line | None) -> None:
        """Put the loss into the wire."""
        assert line is not None  # noqa: S101  (the adapter was asked)
        line.wire = self._half

    def _half(self, data: bytes) -> bytes:
        return data[: len(data) // 2] if self.rng.random() < self.value else data
