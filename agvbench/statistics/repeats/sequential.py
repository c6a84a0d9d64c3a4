"""A comparison that is analysed after every round of repeats, until each difference is decided.

Differences are tested as in `agvbench.statistics.comparison`: by rank sums, and against both ends of the margin. Their
p-values at each analysis become sequential p-values (`agvbench.statistics.repeats.group_sequential`), which allow for
all analyses. These are corrected for all comparisons: after Holm for worse and better, after Hochberg for the same
within the margin. The chance of any false difference in one direction is at most `SequentialPlan.alpha`, that of any
false "same" `SequentialPlan.alpha_same`, over all comparisons and analyses.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

from agvbench.statistics.differences import (
    ALL,
    ALPHA,
    ALPHA_SAME,
    ComparisonVerdict,
    Difference,
    decide,
    raw_differences,
)
from agvbench.statistics.hypothesis_tests import hochberg, holm, minimum_attainable_p
from agvbench.statistics.matching import Cell
from agvbench.statistics.quantities import END_POSE
from agvbench.statistics.repeats.group_sequential import Schedule, Spending, rank_sum_information, sequential_p

FEWEST_REPEATS = 3
"""Before the first analysis: two repeats decide nothing."""
_LEAST_STEP = 0.01
"""Of the planned information: analyses that are closer together decide hardly anything, and cost quadrature nodes."""

Key = tuple[str, str, str]
"""Trajectory, condition and the quantity's column."""


class Decision(StrEnum):
    """What a sequential comparison came to."""

    OPEN = "open"
    REGRESSION = "regression"
    NO_REGRESSION = "no regression"


@dataclass(frozen=True)
class SequentialPlan:
    """What is fixed before the first run: most and fewest repeats of b, levels, and how they are spent.

    ``repeats_a`` is the smallest number of repeats in a; ``margins`` are by the column of the quantity, in its unit.
    """

    repeats_a: int
    most_repeats: int
    margins: Mapping[str, float]
    fewest_repeats: int = FEWEST_REPEATS
    alpha: float = ALPHA
    alpha_same: float = ALPHA_SAME
    spending: Spending = Spending.CUBIC

    def is_due(self, repeats: int, before: int) -> bool:
        """Whether to analyse after `repeats`, where the last analysis was after `before` (0: none).

        >>> plan = SequentialPlan(repeats_a=10, most_repeats=20, margins={})
        >>> [plan.is_due(n, before) for n, before in ((2, 0), (3, 0), (3, 3), (4, 3))]
        [False, True, False, True]
        """
        if repeats <= before or repeats >= self.most_repeats:
            return repeats > before
        return repeats >= self.fewest_repeats and self._share(repeats) - self._share(before) >= _LEAST_STEP

    def _share(self, repeats: int) -> float:
        most = rank_sum_information(self.repeats_a, self.most_repeats)
        return rank_sum_information(self.repeats_a, repeats) / most

    def can_differ(self, comparisons: int) -> bool:
        """Whether the most repeats can show a difference in one of so many comparisons.

        >>> [SequentialPlan(n, 20, {}).can_differ(18) for n in (2, 10)]
        [False, True]
        """
        return minimum_attainable_p(self.repeats_a, self.most_repeats) <= self.alpha / comparisons


@dataclass(frozen=True)
class Observation:
    """One comparison at one analysis, uncorrected: its sizes, its difference of medians (b − a), one-sided p-values.

    ``information`` is the share of that which the most repeats give. Without runs of b all p-values are 1.
    """

    key: Key
    repeats_a: int
    repeats_b: int
    information: float
    difference: float
    p_worse: float
    p_better: float
    p_same: float


@dataclass(frozen=True)
class Analysis:
    """All comparisons after a number of complete rounds of repeats."""

    repeats: int
    observations: tuple[Observation, ...]


@dataclass(frozen=True)
class SequentialVerdict:
    """The verdict on one comparison after all analyses so far, with its sequential p-values, corrected."""

    key: Key
    difference: float
    margin: float
    p_worse: float
    p_better: float
    p_same: float
    verdict: ComparisonVerdict

    @property
    def is_open(self) -> bool:
        """Whether neither a difference nor its absence was shown."""
        return self.verdict is ComparisonVerdict.INCONCLUSIVE


def compared_keys(cells: Collection[tuple[str, str]]) -> list[Key]:
    """Return what is compared of these trajectories and conditions: each by itself, and several together."""
    places = [*cells, (ALL, "all")] if len(cells) > 1 else list(cells)
    return [(*place, quantity.column) for place in places for quantity in END_POSE]


def analyse(
    cells: Sequence[Cell], expected: Collection[tuple[str, str]], plan: SequentialPlan, repeats: int
) -> Analysis:
    """Return the analysis after `repeats` rounds of all `expected` trajectories and conditions.

    ``cells`` are those of them that both sides have; the others have no p-value yet.
    """
    compared = [cell for cell in cells if (cell.trajectory, cell.condition) in expected]
    margins = {q: plan.margins[q.column] for q in END_POSE}
    raw = raw_differences(compared, margins, resamples=1, seed=0)
    observed = {o.key: o for o in (_observed(r.difference, compared, plan) for r in raw)}
    return Analysis(repeats, tuple(observed.get(key, _unobserved(key)) for key in compared_keys(expected)))


def _unobserved(key: Key) -> Observation:
    return Observation(key, 0, 0, 0.0, math.nan, 1.0, 1.0, 1.0)


def _observed(d: Difference, cells: Sequence[Cell], plan: SequentialPlan) -> Observation:
    place = d.trajectory, d.condition
    among = [cell for cell in cells if d.trajectory == ALL or (cell.trajectory, cell.condition) == place]
    sizes = [(len(a), len(b)) for cell in among for a, b in cell.strata(d.quantity)]
    share = _information(sizes) / _information([(n_a, plan.most_repeats) for n_a, _ in sizes])
    p_values = d.p_worse, d.p_better, d.p_same
    return Observation((*place, d.quantity.column), d.a.repeats, d.b.repeats, share, d.interval.estimate, *p_values)


def _information(sizes: Iterable[tuple[int, int]]) -> float:
    """Return the information of the sum of rank sums of strata (n_a, n_b): its pairs squared, over its variance."""
    pairs = [(n_a * n_b, rank_sum_information(n_a, n_b)) for n_a, n_b in sizes]
    return sum(count for count, _ in pairs) ** 2 / sum(count**2 / information for count, information in pairs)


def verdicts(analyses: Sequence[Analysis], plan: SequentialPlan) -> list[SequentialVerdict]:
    """Return the verdict on every comparison of the last analysis, by all analyses so far.

    Worse and better need a corrected sequential p-value of at most ``plan.alpha``, and a difference beyond the margin
    in the last analysis; the same needs one of at most ``plan.alpha_same``.
    """
    last = analyses[-1].observations if analyses else ()
    histories = [_History.of(analyses, observation.key, plan) for observation in last]
    worse, better, same = (
        [history.sequential(name, plan.spending) for history in histories] for name in ("p_worse", "p_better", "p_same")
    )
    corrected = zip(holm(worse), holm(better), hochberg(same), strict=True)
    return [_verdict(o, plan, *p_values) for o, p_values in zip(last, corrected, strict=True)]


@dataclass(frozen=True)
class _History:
    """The observations of one comparison, and the schedule of its analyses."""

    observations: tuple[Observation, ...]
    schedule: Schedule

    @classmethod
    def of(cls, analyses: Sequence[Analysis], key: Key, plan: SequentialPlan) -> _History:
        """Return those of `key`; the last planned analysis may spend whatever is left of the level."""
        found = [(a.repeats, o) for a in analyses for o in a.observations if o.key == key and o.repeats_b]
        shares = [1.0 if repeats >= plan.most_repeats else o.information for repeats, o in found]
        schedule = tuple((o.information, share) for (_, o), share in zip(found, shares, strict=True))
        return cls(tuple(o for _, o in found), schedule)

    def sequential(self, name: str, spending: Spending) -> float:
        """Return the sequential p-value of the p-values in the field `name`."""
        return sequential_p([getattr(o, name) for o in self.observations], self.schedule, spending)


def _verdict(
    observed: Observation, plan: SequentialPlan, p_worse: float, p_better: float, p_same: float
) -> SequentialVerdict:
    margin = plan.margins[observed.key[2]]
    verdict = decide(
        observed.difference,
        margin,
        p_worse=p_worse,
        p_better=p_better,
        p_same=p_same,
        alpha=plan.alpha,
        alpha_same=plan.alpha_same,
    )
    return SequentialVerdict(observed.key, observed.difference, margin, p_worse, p_better, p_same, verdict)


def decision(found: Sequence[SequentialVerdict]) -> Decision:
    """Return what the verdicts amount to: one worse is a regression, whatever else is open."""
    if any(v.verdict is ComparisonVerdict.WORSE for v in found):
        return Decision.REGRESSION
    return Decision.OPEN if not found or any(v.is_open for v in found) else Decision.NO_REGRESSION
