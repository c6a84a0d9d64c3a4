"""The faults of one adapter: which hold, in which run, and whose randomness it is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

import numpy as np

from agvbench.adapters.impairment.fault import Fault
from agvbench.adapters.impairment.spec import Impairment
from agvbench.adapters.seeding import run_seed

Kind = TypeVar("Kind", bound=Fault)


class Faults(Generic[Kind]):
    """Faults in the order in which they were asked for, begun anew for every run.

    Runs of a simulation are counted from 1; a real adapter's are all the first.
    """

    def __init__(self, impairments: list[Impairment], make: Callable[[Impairment], Kind], *, seed: int) -> None:
        self._each = [(impairment, make(impairment)) for impairment in impairments]
        self._seed, self._runs_begun = seed, 0

    def __iter__(self) -> Iterator[tuple[Impairment, Kind]]:
        """Every fault, beside when it holds."""
        return iter(self._each)

    @property
    def names(self) -> str:
        """What an identity says of them."""
        return " ".join(impairment.name for impairment, _ in self._each)

    @property
    def run(self) -> int:
        """Which run it is."""
        return max(1, self._runs_begun)

    def begin(self, run_key: str) -> None:
        """Begin a simulated run; all faults draw from one generator, which follows from the run's name."""
        self._runs_begun += 1
        rng = np.random.default_rng(run_seed(self._seed, run_key, "impairment", bits=128))
        for _, fault in self._each:
            fault.begin(rng)
