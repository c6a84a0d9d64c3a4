"""The verdict on one difference: better, same within the margin, worse, or: these repeats cannot say."""

from __future__ import annotations

from collections.abc import Collection
from enum import StrEnum

ALPHA = 0.01
ALPHA_SAME = 0.05


class Verdict(StrEnum):
    """What the repeats say about b against a; smaller errors are better."""

    BETTER = "better"
    SAME = "same within margin"
    WORSE = "worse"
    UNKNOWN = "cannot say"


def overall(verdicts: Collection[Verdict]) -> Verdict:
    """Return the verdict on something of which several quantities were judged.

    It is worse where one of them is, better where one of them is and none can be worse, and the same where all are.

    >>> overall([Verdict.BETTER, Verdict.WORSE]), overall([Verdict.BETTER, Verdict.SAME])
    (<Verdict.WORSE: 'worse'>, <Verdict.BETTER: 'better'>)
    """
    for verdict in (Verdict.WORSE, Verdict.UNKNOWN, Verdict.BETTER):
        if verdict in verdicts:
            return verdict
    return Verdict.SAME


def decide(
    difference: float,
    margin: float,
    *,
    p_worse: float,
    p_better: float,
    p_same: float,
    alpha: float = ALPHA,
    alpha_same: float = ALPHA_SAME,
) -> Verdict:
    """Return the verdict on a `difference` of medians (b − a) against a noise band of ±`margin`.

    Worse (better) takes both: significance after correction for all comparisons, and an estimate beyond the margin. The
    same takes two one-sided tests, each against one end of the band (TOST): absence of evidence is not the same.

    Parameters
    ----------
    difference, margin
        In the same unit; `margin` is not negative.
    p_worse, p_better
        One-sided p-values of no difference, corrected for multiplicity.
    p_same
        The larger p-value of the two one-sided tests of a difference of at least the margin, uncorrected.
    alpha, alpha_same
        The levels that the former and the latter are held against.

    Examples
    --------
    >>> decide(9.0, 2.0, p_worse=0.001, p_better=1.0, p_same=1.0)
    <Verdict.WORSE: 'worse'>
    >>> decide(0.1, 2.0, p_worse=0.4, p_better=0.6, p_same=0.2)
    <Verdict.UNKNOWN: 'cannot say'>
    """
    if p_worse <= alpha and difference > margin:
        return Verdict.WORSE
    if p_better <= alpha and difference < -margin:
        return Verdict.BETTER
    return Verdict.SAME if p_same <= alpha_same else Verdict.UNKNOWN
