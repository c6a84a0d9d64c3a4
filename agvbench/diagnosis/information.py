"""What each run tells of the parameters, as much of it as is not zero."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from agvbench.types import Floats


@dataclass(frozen=True)
class Information:
    """Quadratic forms of R runs in P parameters, of which each run depends on m at most.

    ``own`` (R, m): the numbers of these; ``blocks`` (R, m, m): the forms in them; ``count`` is P.
    """

    own: NDArray[np.int64]
    blocks: Floats
    count: int

    @cached_property
    def total(self) -> Floats:
        """The sum over all runs (P, P)."""
        return self._sum(self._places, self.blocks)

    def total_of(self, runs: NDArray[np.bool_]) -> Floats:
        """Return the sum over some `runs` (R,), shape (P, P)."""
        return self._sum(self._places[runs], self.blocks[runs])

    def dense(self) -> Floats:
        """Return every run's form (R, P, P), zeros and all."""
        out = np.zeros((len(self.own), self.count * self.count))
        np.put_along_axis(out, self._places.reshape(len(out), -1), self.blocks.reshape(len(out), -1), axis=1)
        return out.reshape(-1, self.count, self.count)

    def along(self, move: Floats) -> Floats:
        """Return what each run's form (R,) makes of a `move` (P,)."""
        own = move[self.own]
        return np.asarray(np.einsum("rij,ri,rj->r", self.blocks, own, own))

    @cached_property
    def _places(self) -> NDArray[np.int64]:
        return self.own[:, :, None] * self.count + self.own[:, None, :]

    def _sum(self, places: NDArray[np.int64], blocks: Floats) -> Floats:
        size = self.count * self.count
        summed = np.bincount(places.ravel(), blocks.ravel(), size)
        return np.asarray(summed, dtype=np.float64).reshape(self.count, self.count)
