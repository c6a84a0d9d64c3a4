"""Runs in threads: no run depends on another, so any number of threads predicts the same poses to the last bit.

The number is numba's: that of the processors this process may use, or ``$NUMBA_NUM_THREADS``.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np
from numpy.typing import NDArray

try:
    from numba import config
except ModuleNotFoundError:  # the light installation: the interpreter's lock lets one thread run
    config = None

Integers = NDArray[np.int64]

_LEAST_RUNS = 16
"""Fewer runs take less time than it takes to wake a thread for them."""


def in_threads(simulate: Callable[[Integers], None], runs: Integers) -> None:
    """Call `simulate` with shares of the `runs` (n,), one in each thread; it must not hold the interpreter's lock.

    An error that it raises is raised here, once all shares have ended.
    """
    count = min(thread_count(), len(runs) // _LEAST_RUNS)
    if count < 2:
        simulate(runs)
        return
    # Neighbours are often variants of one run, and take equally long: dealing them out balances the shares.
    first, *rest = (np.ascontiguousarray(runs[k::count]) for k in range(count))
    waiting = [_pool().submit(simulate, share) for share in rest]
    try:
        simulate(first)
    finally:
        errors = [future.exception() for future in waiting]
    for error in filter(None, errors):
        raise error


def thread_count() -> int:
    """Return the number of threads that simulate."""
    return 1 if config is None else int(config.NUMBA_NUM_THREADS)


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(thread_count(), thread_name_prefix="simulation")


# The threads of a pool are not copied by a fork: the child starts its own.
os.register_at_fork(after_in_child=_pool.cache_clear)
