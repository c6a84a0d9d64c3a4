"""Randomness of a run: it hangs on the campaign's seed and the run's own key, never on the order of runs."""

from __future__ import annotations

import hashlib


def run_seed(seed: int, run_key: str, purpose: str, bits: int = 32) -> int:
    """Return a seed of `bits` bits for one purpose in one run.

    >>> run_seed(0, "steering-0001", "plant") == run_seed(0, "steering-0001", "plant")
    True
    >>> run_seed(0, "steering-0001", "plant") == run_seed(0, "steering-0001", "camera")
    False
    """
    text = f"agvbench\0{seed}\0{run_key}\0{purpose}"
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[: bits // 8], "little")
