"""What stands in for a blind trial on the workers of tests."""

from __future__ import annotations

import time

from agvbench.challenge.trial import Trial


def trial(spec: str, seed: int, _: int) -> Trial:
    """Stand in for a blind trial: what it finds depends on what is hidden alone."""
    time.sleep(0.05 * (seed % 3))
    return Trial(spec, seed, "library", (spec,), (spec,), (), False, False, {}, "NAMED", (spec,), seconds=float(seed))
