"""Streams of random numbers that follow from seeds alone."""

from __future__ import annotations

import numpy as np


def random_stream(*keys: int) -> np.random.Generator:
    """Return the stream of these keys, whole numbers of any size and sign."""
    return np.random.default_rng([key % 2**64 for key in keys])
