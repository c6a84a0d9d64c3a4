"""One difference between two sides: how large, how sure, and the verdict."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from agvbench.statistics.bootstrap import Interval, average_difference_interval, median_difference_interval
from agvbench.statistics.cells import Cell, Strata
from agvbench.statistics.effect_size import cliffs_delta
from agvbench.statistics.multiplicity import can_speak, holm_of_those_that_can_speak
from agvbench.statistics.outliers import classify_outliers
from agvbench.statistics.power import smallest_visible_difference
from agvbench.statistics.quantities import DISTANCE, Quantity
from agvbench.statistics.rank_test import rank_test
from agvbench.statistics.verdict import Verdict, decide
from agvbench.types import Floats

ALL = "all trajectories"


@dataclass(frozen=True)
class Sample:
    """One side of a comparison: how many repeats, their median and standard deviation, and their outliers."""

    repeats: int
    median: float
    sd: float
    outliers: str


@dataclass(frozen=True)
class Difference:
    """Side b against side a in one quantity of one trajectory and condition (or of all together).

    ``interval`` is the difference of medians with its 95 % bootstrap interval, for itself alone; ``p_worse`` and
    ``p_better`` are corrected for all comparisons, ``p_same`` is not; ``able`` says whether so many repeats could
    reach significance at all, ``visible`` about the smallest difference that they find nine times in ten
    (infinite: none); ``cliffs_delta`` is positive where b is worse. Where it does not `decide`, its verdict is a note.
    """

    trajectory: str
    condition: str
    quantity: Quantity
    margin: float
    a: Sample
    b: Sample
    interval: Interval
    p_worse: float
    p_better: float
    p_same: float
    cliffs_delta: float
    visible: float
    able: bool
    verdict: Verdict
    decides: bool = True

    @property
    def shown_verdict(self) -> str:
        """The verdict as tables print it: in brackets where it does not decide."""
        return str(self.verdict) if self.decides else f"({self.verdict})"


@dataclass(frozen=True)
class Untold:
    """A difference before correction, with the smallest p-value its test could give."""

    difference: Difference
    least_p: float


def of_cell(cell: Cell, quantity: Quantity, margin: float, resamples: int, seed: int) -> Untold:
    """Return the difference in one cell, before correction."""
    a, b = cell.values(quantity)
    interval = median_difference_interval(a, b, resamples=resamples, seed=seed)
    names = cell.trajectory, cell.condition
    return _tested(names, quantity, margin, (_sample(a), _sample(b)), interval, cell.strata(quantity))


def of_all(cells: Sequence[Cell], quantity: Quantity, margin: float, resamples: int, seed: int) -> Untold:
    """Test all cells together: a small change everywhere shows here before it shows anywhere."""
    pairs = [cell.values(quantity) for cell in cells]
    samples = [
        replace(_sample(np.concatenate(side)), median=float(np.mean([np.median(v) for v in side])), sd=_pooled_sd(side))
        for side in zip(*pairs, strict=True)
    ]
    interval = average_difference_interval(pairs, resamples=resamples, seed=seed)
    strata = [stratum for cell in cells for stratum in cell.strata(quantity)]
    return _tested((ALL, "all"), quantity, margin, (samples[0], samples[1]), interval, strata)


def _tested(
    names: tuple[str, str],
    quantity: Quantity,
    margin: float,
    samples: tuple[Sample, Sample],
    interval: Interval,
    strata: Strata,
) -> Untold:
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
        cliffs_delta=cliffs_delta(plain.superiority),
        visible=math.nan,
        able=False,
        verdict=Verdict.UNKNOWN,
    )
    return Untold(difference, plain.least_p)


def judge_families(raw: Sequence[Untold], deciding: Collection[Quantity], alpha: float) -> tuple[list[Difference], int]:
    """Return what `judge` does, with the quantities that decide and those that are notes as two families.

    Each family has its own chance `alpha` of a false alarm: notes cost the decision no power, and cannot change it.
    """
    judged: dict[int, Difference] = {}
    counts = {True: 1, False: 1}
    for decides in counts:
        family = [k for k, r in enumerate(raw) if (r.difference.quantity in deciding) is decides]
        found, counts[decides] = judge([raw[k] for k in family], alpha)
        judged |= {k: replace(d, decides=decides) for k, d in zip(family, found, strict=True)}
    return [judged[k] for k in range(len(raw))], counts[True]


def judge(raw: Sequence[Untold], alpha: float) -> tuple[list[Difference], int]:
    """Return the differences with corrected p-values and verdicts, and how many tests the correction counted.

    |Δs| is not tested where counting its tests would leave too few repeats for a test of the end pose: of a run that
    ends elsewhere it sees a part of what the end position error sees.
    """
    least = _least_p(raw, alpha)
    able = can_speak(least, alpha)
    tests = max(1, sum(able))
    worse = holm_of_those_that_can_speak([r.difference.p_worse for r in raw], least, alpha)
    better = holm_of_those_that_can_speak([r.difference.p_better for r in raw], least, alpha)
    judged = []
    for r, p_worse, p_better, spoke in zip(raw, worse, better, able, strict=True):
        d = replace(r.difference, p_worse=p_worse, p_better=p_better, able=spoke)
        verdict = decide(
            d.interval.estimate, d.margin, p_worse=p_worse, p_better=p_better, p_same=d.p_same, alpha=alpha
        )
        judged.append(replace(d, verdict=verdict, visible=_visible(d, alpha / tests) if spoke else math.inf))
    return judged, tests


def _least_p(raw: Sequence[Untold], alpha: float) -> list[float]:
    """Return the smallest p-values that tests could give, 1 for those that are not made."""
    every = [r.least_p for r in raw]
    end_poses = [1.0 if r.difference.quantity == DISTANCE else r.least_p for r in raw]
    silenced = zip(can_speak(end_poses, alpha), can_speak(every, alpha), strict=True)
    return end_poses if any(alone and not together for alone, together in silenced) else every


def _visible(d: Difference, alpha: float) -> float:
    sd = math.sqrt((d.a.sd**2 + d.b.sd**2) / 2.0)
    return smallest_visible_difference(sd, d.a.repeats, d.b.repeats, alpha=alpha)


def _sample(values: Floats) -> Sample:
    sd = float(np.std(values, ddof=1)) if len(values) > 1 else math.nan
    return Sample(len(values), float(np.median(values)), sd, str(classify_outliers(values)))


def _pooled_sd(groups: Sequence[Floats]) -> float:
    """Return the standard deviation within groups; NaN where no group has two values."""
    squares = sum(float(np.sum((group - group.mean()) ** 2)) for group in groups)
    freedom = sum(len(group) - 1 for group in groups)
    return math.sqrt(squares / freedom) if freedom else math.nan
