"""Compare two sets of runs: where b is worse than a, and how sure that is.

Every comparison is a rank-sum test of |Δs| or |Δδ|, exact for small samples. Holm's correction covers all of them,
so that two campaigns that do not differ report a regression with a chance of at most 1 %, whatever their noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from agvbench.errors import FlagError
from agvbench.statistics.bootstrap import (
    RESAMPLES,
    Interval,
    average_difference_interval,
    median_difference_interval,
)
from agvbench.statistics.cells import Cell, Strata, match_cells
from agvbench.statistics.effect_size import cliffs_delta
from agvbench.statistics.multiplicity import can_speak, holm_of_those_that_can_speak
from agvbench.statistics.outliers import classify_outliers
from agvbench.statistics.power import smallest_visible_difference
from agvbench.statistics.quantities import QUANTITIES, Quantity
from agvbench.statistics.rank_test import rank_test
from agvbench.statistics.sessions import session_note
from agvbench.statistics.verdict import ALPHA, Verdict, decide
from agvbench.types import Floats

if TYPE_CHECKING:
    import pandas as pd

# About what the same vehicle, calibrated anew, differs by from one session to the next.
MARGIN_MM = 5.0
MARGIN_DEG = 1.0
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
    (infinite: none); ``cliffs_delta`` is positive where b is worse.
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


@dataclass(frozen=True)
class Comparison:
    """All differences between two sets of runs, and what they do and do not mean."""

    name_a: str
    name_b: str
    differences: tuple[Difference, ...]
    left_out: tuple[str, ...]
    notes: tuple[str, ...]
    alpha: float
    tests: int

    def of(self, verdict: Verdict) -> list[Difference]:
        """Return the differences with this verdict."""
        return [difference for difference in self.differences if difference.verdict is verdict]

    @property
    def is_regression(self) -> bool:
        """Whether anything is worse beyond its margin."""
        return bool(self.of(Verdict.WORSE))

    @property
    def could_compare(self) -> bool:
        """Whether some difference could have been found, or every one was ruled out."""
        return any(d.able for d in self.differences) or not self.of(Verdict.UNKNOWN)


def compare(
    a: pd.DataFrame,
    b: pd.DataFrame,
    *,
    margin_mm: float = MARGIN_MM,
    margin_deg: float = MARGIN_DEG,
    conditions: tuple[str, str] | None = None,
    same_campaign: bool = False,
    names: tuple[str, str] = ("A", "B"),
    alpha: float = ALPHA,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Comparison:
    """Compare the errors of `b` with those of `a` in |Δs| and |Δδ|.

    Parameters
    ----------
    a, b
        What `pose_errors` returns. Runs that were rejected or could not be measured do not count.
    margin_mm, margin_deg
        The noise band: median differences within it are no regression, however significant.
    conditions
        Compare the first condition of `a` with the second of `b`; without it, equal conditions are compared.
    same_campaign
        `a` and `b` come from the same campaign, so that sessions of one name are the same session and runs are compared
        within it.
    names
        What to call the two sides.
    alpha
        The chance of reporting any regression where there is none, over all trajectories and both quantities.
    resamples, seed
        Of the bootstrap.

    Raises
    ------
    InputError
        If there is nothing in common, or a side has no run that counts.
    FlagError
        If a margin is negative or not finite.
    """
    margins = checked_margins(margin_mm, margin_deg)
    cells, left_out = match_cells(a, b, conditions=conditions, same_campaign=same_campaign)
    raw = [_of_cell(cell, q, margins[q], resamples, seed) for cell in cells for q in QUANTITIES]
    if len(cells) > 1:
        raw += [_of_all(cells, q, margins[q], resamples, seed) for q in QUANTITIES]
    differences, tests = _judged(raw, alpha)
    note = session_note(cells, same_campaign=same_campaign)
    return Comparison(*names, tuple(differences), tuple(left_out), (note,), alpha, tests)


@dataclass(frozen=True)
class _Raw:
    """A difference before correction, with the smallest p-value its test could give."""

    difference: Difference
    least_p: float


def checked_margins(margin_mm: float, margin_deg: float) -> dict[Quantity, float]:
    """Return the margin of every quantity.

    Raises
    ------
    FlagError
        If one is negative or not finite.
    """
    return {q: _margin(m, q) for q, m in zip(QUANTITIES, (margin_mm, margin_deg), strict=True)}


def _margin(value: float, quantity: Quantity) -> float:
    if not (math.isfinite(value) and value >= 0.0):
        flag = f"--margin-{quantity.unit}"
        raise FlagError(
            "margin cannot be used", where=flag, value=value, limit=f"a finite number of {quantity.unit} ≥ 0"
        )
    return value


def _of_cell(cell: Cell, quantity: Quantity, margin: float, resamples: int, seed: int) -> _Raw:
    a, b = cell.values(quantity)
    interval = median_difference_interval(a, b, resamples=resamples, seed=seed)
    names = cell.trajectory, cell.condition
    return _tested(names, quantity, margin, (_sample(a), _sample(b)), interval, cell.strata(quantity))


def _of_all(cells: Sequence[Cell], quantity: Quantity, margin: float, resamples: int, seed: int) -> _Raw:
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
) -> _Raw:
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
    return _Raw(difference, plain.least_p)


def _judged(raw: Sequence[_Raw], alpha: float) -> tuple[list[Difference], int]:
    least = [r.least_p for r in raw]
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
