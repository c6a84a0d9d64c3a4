# mypy: disallow-untyped-decorators=False, warn-return-any=False
"""The grid of an integrator with steps of fixed length, which does not depend on how time is divided into calls."""

from __future__ import annotations

import math

from agvbench.compiled import cached_njit

_ROUNDING = 1e-9  # of a step: a call that ends this close to a grid point ends on it


@cached_njit()
def whole_steps(since_s: float, step_s: float) -> tuple[int, float]:
    """Return how many whole steps there are in the time since a grid point, and the rest of it [s]."""
    steps = math.floor(since_s / step_s + _ROUNDING)
    rest = since_s - steps * step_s
    return steps, 0.0 if rest < _ROUNDING * step_s else rest
