"""``cut``: the line breaks in the middle of a command; nothing arrives any more."""

from __future__ import annotations

import numpy as np

from agvbench.adapters.impairment.fault import Line, VehicleFault


class Cut(VehicleFault):
    """A cable that is torn, or a battery of a radio that is empty: only bytes to the vehicle are lost."""

    name = "cut"
    needs_line = True

    def begin(self, rng: np.random.Generator) -> None:
        """Nothing is cut yet."""
        super().begin(rng)
        self._is_cut = False

    def strike(self, line: Line | None) -> None:
        """Put the break into the wire."""
        assert line is not None  # noqa: S101  (the adapter was asked)
        line.wire = self._half_then_nothing

    def _half_then_nothing(self, data: bytes) -> bytes:
        left = b"" if self._is_cut else data[: len(data) // 2]
        self._is_cut = True
        return left
