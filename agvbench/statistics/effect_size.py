"""How large a difference is, apart from whether it is there: Cliff's delta."""

from __future__ import annotations


def cliffs_delta(superiority: float) -> float:
    """Return Cliff's delta, P(b > a) − P(b < a), from A₁₂ = P(b > a) + P(b = a) / 2.

    >>> cliffs_delta(1.0), cliffs_delta(0.5)
    (1.0, 0.0)
    """
    return 2.0 * superiority - 1.0
