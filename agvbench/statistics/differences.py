"""One difference between two sides: its size, its confidence interval, its verdict.

`EndShift` stands beside the tests: an end position error may stay as it is while runs end on the other side of their
target.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from agvbench.statistics.descriptive import classify_outliers
from agvbench.statistics.hypothesis_tests import (
    holm_tarone,
    minimum_detectable_difference,
    rank_test,
    tarone_testable,
)
from agvbench.statistics.intervals import (
    Interval,
    average_difference_interval,
    mean_difference_interval,
    median_difference_interval,
)
from agvbench.statistics.matching import Cell, Strata
from agvbench.statistics.quantities import DISTANCE, Quantity
from agvbench.types import Floats

ALPHA = 0.01
ALPHA_SAME = 0.05


class ComparisonVerdict(StrEnum):
    """What the repeats say about b against a; smaller errors are better."""

    BETTER = "better"
    SAME = "same within margin"
    WORSE = "worse"
    INCONCLUSIVE = "cannot say"


def overall(verdicts: Collection[ComparisonVerdict]) -> ComparisonVerdict:
    """Return the verdict on something of which several quantities were judged.

    It is worse where one of them is, better where one of them is and none can be worse, and the same where all are.

    >>> better, same, worse = ComparisonVerdict.BETTER, ComparisonVerdict.SAME, ComparisonVerdict.WORSE
    >>> overall([better, worse]), overall([better, same])
    (<ComparisonVerdict.WORSE: 'worse'>, <ComparisonVerdict.BETTER: 'better'>)
    """
    for verdict in (ComparisonVerdict.WORSE, ComparisonVerdict.INCONCLUSIVE, ComparisonVerdict.BETTER):
        if verdict in verdicts:
            return verdict
    return ComparisonVerdict.SAME


def decide(
    difference: float,
    margin: float,
    *,
    p_worse: float,
    p_better: float,
    p_same: float,
    alpha: float = ALPHA,
    alpha_same: float = ALPHA_SAME,
) -> ComparisonVerdict:
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
        The larger p-value of the two one-sided tests of a difference of at least the margin.
    alpha, alpha_same
        The levels that `p_worse` and `p_better`, and `p_same`, are held against.

    Examples
    --------
    >>> decide(9.0, 2.0, p_worse=0.001, p_better=1.0, p_same=1.0)
    <ComparisonVerdict.WORSE: 'worse'>
    >>> decide(0.1, 2.0, p_worse=0.4, p_better=0.6, p_same=0.2)
    <ComparisonVerdict.INCONCLUSIVE: 'cannot say'>
    """
    if p_worse <= alpha and difference > margin:
        return ComparisonVerdict.WORSE
    if p_better <= alpha and difference < -margin:
        return ComparisonVerdict.BETTER
    return ComparisonVerdict.SAME if p_same <= alpha_same else ComparisonVerdict.INCONCLUSIVE


ALL = "all trajectories"


@dataclass(frozen=True)
class SampleSummary:
    """One side of a comparison: how many repeats, their median and standard deviation, and their outliers."""

    repeats: int
    median: float
    sd: float
    outliers: str


@dataclass(frozen=True)
class Difference:
    """Side b against side a in one quantity of one trajectory and condition (or of all together).

    ``interval`` is the difference of medians with its 95 % bootstrap interval, for itself alone; ``p_worse`` and
    ``p_better`` are corrected for all comparisons, ``p_same`` is not; ``testable`` says whether so many repeats could
    reach significance at all, ``minimum_detectable`` about the smallest difference that they find nine times in ten
    (infinite: none); ``cliffs_delta`` is P(b > a) − P(b < a), positive where b is worse. Of all trajectories together
    the interval is of the mean difference of medians, while tests and Cliff's delta count pairs: their signs may differ
    where few large decreases outweigh many small increases. Where it does not `decide`, its verdict is a note.
    """

    trajectory: str
    condition: str
    quantity: Quantity
    margin: float
    a: SampleSummary
    b: SampleSummary
    interval: Interval
    p_worse: float
    p_better: float
    p_same: float
    cliffs_delta: float
    minimum_detectable: float
    testable: bool
    verdict: ComparisonVerdict
    decides: bool = True

    @property
    def shown_verdict(self) -> str:
        """The verdict as tables print it: in brackets where it does not decide."""
        return str(self.verdict) if self.decides else f"({self.verdict})"


@dataclass(frozen=True)
class RawDifference:
    """A difference before correction, with the smallest p-value its test could give."""

    difference: Difference
    minimum_p: float


def of_cell(cell: Cell, quantity: Quantity, margin: float, resamples: int, seed: int) -> RawDifference:
    """Return the difference in one cell, before correction."""
    a, b = cell.values(quantity)
    interval = median_difference_interval(a, b, resamples=resamples, seed=seed)
    names = cell.trajectory, cell.condition
    return _tested(names, quantity, margin, (_sample(a), _sample(b)), interval, cell.strata(quantity))


def of_all(cells: Sequence[Cell], quantity: Quantity, margin: float, resamples: int, seed: int) -> RawDifference:
    """Test all cells together: a small change everywhere shows here before it shows anywhere."""
    pairs = [cell.values(quantity) for cell in cells]
    samples = [
        replace(_sample(np.concatenate(side)), median=float(np.mean([np.median(v) for v in side])), sd=pooled_sd(side))
        for side in zip(*pairs, strict=True)
    ]
    interval = average_difference_interval(pairs, resamples=resamples, seed=seed)
    strata = [stratum for cell in cells for stratum in cell.strata(quantity)]
    return _tested((ALL, "all"), quantity, margin, (samples[0], samples[1]), interval, strata)


def raw_differences(
    cells: Sequence[Cell], margins: Mapping[Quantity, float], resamples: int, seed: int
) -> list[RawDifference]:
    """Return every difference before correction: of each cell and quantity, then of all cells together."""
    raw = [of_cell(cell, q, margins[q], resamples, seed) for cell in cells for q in margins if cell.has(q)]
    for quantity, margin in margins.items():
        having = [cell for cell in cells if cell.has(quantity)]
        if len(having) > 1:
            raw.append(of_all(having, quantity, margin, resamples, seed))
    return raw


def _tested(
    names: tuple[str, str],
    quantity: Quantity,
    margin: float,
    samples: tuple[SampleSummary, SampleSummary],
    interval: Interval,
    strata: Strata,
) -> RawDifference:
    plain = rank_test(strata)
    at_least_worse = rank_test([(a + margin, b) for a, b in strata]).p_less
    at_least_better = rank_test([(a - margin, b) for a, b in strata]).p_greater
    difference = Difference(
        *names,
        quantity,
        margin,
        *samples,
        interval,
        p_worse=plain.p_greater,
        p_better=plain.p_less,
        p_same=max(at_least_worse, at_least_better),
        cliffs_delta=plain.cliffs_delta,
        minimum_detectable=math.nan,
        testable=False,
        verdict=ComparisonVerdict.INCONCLUSIVE,
    )
    return RawDifference(difference, plain.minimum_p)


def decide_families(
    raw: Sequence[RawDifference], deciding: Collection[Quantity], alpha: float
) -> tuple[list[Difference], int]:
    """Return what `decide_family` does, with the quantities that decide and those that are notes as two families.

    Each family has its own chance `alpha` of a false alarm: notes cost the decision no power, and cannot change it.
    """
    decided: dict[int, Difference] = {}
    counts = {True: 1, False: 1}
    for decides in counts:
        family = [k for k, r in enumerate(raw) if (r.difference.quantity in deciding) is decides]
        found, counts[decides] = decide_family([raw[k] for k in family], alpha)
        decided |= {k: replace(d, decides=decides) for k, d in zip(family, found, strict=True)}
    return [decided[k] for k in range(len(raw))], counts[True]


def decide_family(raw: Sequence[RawDifference], alpha: float) -> tuple[list[Difference], int]:
    """Return the differences with corrected p-values and verdicts, and how many tests the correction counted.

    |Δs| is not tested where counting its tests would leave too few repeats for a test of the end pose: of a run that
    ends elsewhere it sees a part of what the end position error sees.
    """
    least = _minimum_p(raw, alpha)
    testable = tarone_testable(least, alpha)
    tests = max(1, sum(testable))
    worse = holm_tarone([r.difference.p_worse for r in raw], least, alpha)
    better = holm_tarone([r.difference.p_better for r in raw], least, alpha)
    decided = []
    for r, p_worse, p_better, is_testable in zip(raw, worse, better, testable, strict=True):
        d = replace(r.difference, p_worse=p_worse, p_better=p_better, testable=is_testable)
        verdict = decide(
            d.interval.estimate, d.margin, p_worse=p_worse, p_better=p_better, p_same=d.p_same, alpha=alpha
        )
        decided.append(
            replace(
                d,
                verdict=verdict,
                minimum_detectable=_minimum_detectable(d, alpha / tests) if is_testable else math.inf,
            )
        )
    return decided, tests


def _minimum_p(raw: Sequence[RawDifference], alpha: float) -> list[float]:
    """Return the smallest p-values that tests could give, 1 for those that are not made."""
    every = [r.minimum_p for r in raw]
    end_poses = [1.0 if r.difference.quantity == DISTANCE else r.minimum_p for r in raw]
    testable_pairs = zip(tarone_testable(end_poses, alpha), tarone_testable(every, alpha), strict=True)
    return end_poses if any(alone and not together for alone, together in testable_pairs) else every


def _minimum_detectable(d: Difference, alpha: float) -> float:
    sd = math.sqrt((d.a.sd**2 + d.b.sd**2) / 2.0)
    return minimum_detectable_difference(sd, d.a.repeats, d.b.repeats, alpha=alpha)


def _sample(values: Floats) -> SampleSummary:
    sd = float(np.std(values, ddof=1)) if len(values) > 1 else math.nan
    return SampleSummary(len(values), float(np.median(values)), sd, str(classify_outliers(values)))


def pooled_sd(groups: Sequence[Floats]) -> float:
    """Return the standard deviation within groups; NaN where no group has two values."""
    squares = sum(float(np.sum((group - group.mean()) ** 2)) for group in groups)
    freedom = sum(len(group) - 1 for group in groups)
    return math.sqrt(squares / freedom) if freedom else math.nan


@dataclass(frozen=True)
class EndShift:
    """Mean end position of side b minus that of side a in one cell, along and across [mm], with 95 % intervals."""

    trajectory: str
    condition: str
    along: Interval
    across: Interval

    @property
    def length_mm(self) -> float:
        """Return how far the mean end position moved [mm]."""
        return math.hypot(self.along.estimate, self.across.estimate)


def end_shift(cell: Cell) -> EndShift:
    """Return the shift of the mean end position in `cell`."""
    along, across = (mean_difference_interval(cell.a.ends_mm[:, k], cell.b.ends_mm[:, k]) for k in (0, 1))
    return EndShift(cell.trajectory, cell.condition, along, across)
