"""``corrupt=SHARE``: that share of the bytes on the line has a wrong bit."""

from __future__ import annotations

from agvbench.adapters.impairment.faults import LineFault


class Corrupt(LineFault):
    """A noisy line."""

    name = "corrupt"
    default = 0.01

    def carry(self, data: bytes) -> bytes:
        """Turn single bits."""
        wrong = self.rng.random(len(data)) < self.value
        bits = self.rng.integers(0, 8, len(data))
        return bytes(byte ^ (int(hit) << int(bit)) for byte, hit, bit in zip(data, wrong, bits, strict=True))
