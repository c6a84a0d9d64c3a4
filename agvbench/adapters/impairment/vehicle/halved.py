"""``halved=SHARE``: that share of the lines arrives without its second half."""

from __future__ import annotations

from agvbench.adapters.impairment.faults import LineFault


class Truncated(LineFault):
    """A buffer that overflows: what is left of a line runs into the next."""

    name = "halved"
    default = 0.1

    def carry(self, data: bytes) -> bytes:
        """Keep the first half of some."""
        return data[: len(data) // 2] if self.rng.random() < self.value else data
