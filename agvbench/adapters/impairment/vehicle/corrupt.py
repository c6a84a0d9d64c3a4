"""``corrupt=SHARE``: that share of the bytes on the line has a wrong bit."""

from __future__ import annotations

from agvbench.adapters.impairment.fault import Line, VehicleFault


class Corrupt(VehicleFault):
    """A noisy line."""

    name = "corrupt"
    usual = 0.01
    needs_line = True

    def strike(self, line: Line | None) -> None:
        """Put the noise into the wire."""
        assert line is not None  # noqa: S101  (the adapter was asked)
        line.wire = self._noise

    def _noise(self, data: bytes) -> bytes:
        wrong = self.rng.random(len(data)) < self.value
        bits = self.rng.integers(0, 8, len(data))
        return bytes(byte ^ (int(hit) << int(bit)) for byte, hit, bit in zip(data, wrong, bits, strict=True))
