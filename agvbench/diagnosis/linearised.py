"""Predicted poses with their derivatives, as few of them as there are."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from agvbench.types import Floats


@dataclass(frozen=True)
class Linearised:
    """Predicted poses and their derivatives, of which only those are kept that may differ from zero.

    ``poses`` (R, K, 3); ``own`` (R, m): the numbers of the parameters that each run depends on at most, of ``count``
    (P); ``by_own`` (R, K, 3, m): derivatives by these; ``by_offsets`` (R, K, 3, 6).
    """

    poses: Floats
    own: NDArray[np.int64]
    by_own: Floats
    by_offsets: Floats
    count: int

    @property
    def by_parameters(self) -> Floats:
        """The derivatives by all parameters (R, K, 3, P), zeros and all."""
        out = np.zeros((*self.poses.shape, self.count))
        np.put_along_axis(out, self.own[:, None, None, :], self.by_own, axis=-1)
        return out

    def with_last(self, slopes: Floats) -> Linearised:
        """Return these and derivatives (R, K, 3, q) by further parameters, which come last."""
        more = np.arange(self.count, self.count + slopes.shape[-1])
        own = np.concatenate([self.own, np.broadcast_to(more, (len(self.own), len(more)))], axis=1)
        by_own = np.concatenate([self.by_own, slopes], axis=-1)
        return replace(self, own=own, by_own=by_own, count=self.count + len(more))

    def by_first(self, count: int) -> Linearised:
        """Return these without the derivatives by the last parameters: by the maps' values alone, or by none.

        In ``own`` the effects come last, and every run depends on each.
        """
        kept = self.own.shape[1] - (self.count - count) if count else 0
        return replace(self, own=self.own[:, :kept], by_own=self.by_own[..., :kept], count=count)
