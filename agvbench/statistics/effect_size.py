"""How large a difference is, apart from whether it is there: Cliff's delta."""

from __future__ import annotations

# Romano and others (2006), widely used; the words are a convention, not a law.
_WORDS = ((0.147, "negligible"), (0.33, "small"), (0.474, "medium"))


def cliffs_delta(superiority: float) -> float:
    """Return Cliff's delta, P(b > a) − P(b < a), from A₁₂ = P(b > a) + P(b = a) / 2.

    >>> cliffs_delta(1.0), cliffs_delta(0.5)
    (1.0, 0.0)
    """
    return 2.0 * superiority - 1.0


def in_words(delta: float) -> str:
    """Return the conventional word for the size of a Cliff's delta.

    >>> in_words(-0.4)
    'medium'
    """
    return next((word for limit, word in _WORDS if abs(delta) < limit), "large")
