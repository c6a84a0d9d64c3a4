"""``cut``: the line breaks in the middle of a command; nothing arrives any more."""

from __future__ import annotations

import numpy as np

from agvbench.adapters.impairment.faults import LineFault


class Cut(LineFault):
    """A cable that is torn, or a battery of a radio that is empty: only bytes to the vehicle are lost."""

    name = "cut"

    def begin(self, rng: np.random.Generator) -> None:
        """Nothing is cut yet."""
        super().begin(rng)
        self._is_cut = False

    def carry(self, data: bytes) -> bytes:
        """Keep half of the first command, and nothing after it."""
        left = b"" if self._is_cut else data[: len(data) // 2]
        self._is_cut = True
        return left
