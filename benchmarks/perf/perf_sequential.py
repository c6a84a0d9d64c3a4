"""Sequential comparisons: false verdicts, and repeats saved, over all comparisons and analyses of a campaign.

    python benchmarks/perf/perf_sequential.py [--campaigns 2000] [--repeats 20] [--json FILE]

Campaigns are drawn: end position and heading errors of eight trajectories, which makes 18 comparisons with those of all
trajectories together. A has as many repeats as B may get at most. Noise is normal or Student's t with 3 degrees of
freedom; shifts and margins are in standard deviations of one repeat. Rates have 95 % Clopper–Pearson bounds. The fixed
number of repeats is the smallest whose tests, made once at the same levels, find the regression as often. Planned: at
most 1 % false regressions, at most 2 % false differences in either direction, at most 5 % false "same".
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import ndtr
from scipy.stats import binomtest

from agvbench.statistics.repeats.group_sequential import (
    Spending,
    level_of,
    rank_sum_information,
    sequential_p_table,
)
from agvbench.statistics.repeats.sequential import SequentialPlan
from agvbench.types import Floats

_TRAJECTORIES = 8
_CELLS = 2 * _TRAJECTORIES
_COMPARISONS = _CELLS + 2
_NOISES = ("normal", "Student's t(3)")


@dataclass(frozen=True)
class Case:
    """Shifts of the cells (position errors first) and the margin, in standard deviations."""

    what: str
    shifts: tuple[float, ...]
    margin: float


def _shifted(count: int, shift: float) -> tuple[float, ...]:
    return (shift,) * count + (0.0,) * (_CELLS - count)


NO_CHANGE = Case("no change", _shifted(0, 0.0), 1.0)
NO_CHANGE_WIDE = Case("no change", _shifted(0, 0.0), 2.0)
HALF_OF_MARGIN = Case("one at half the margin", _shifted(1, 1.0), 2.0)
NEAR_MARGIN = Case("one at 0.75 times the margin", _shifted(1, 1.5), 2.0)
ONE_AT_MARGIN = Case("one at the margin", _shifted(1, 2.0), 2.0)
BETTER_BUT_ONE = Case("seven better, one at the margin", (2.0, *(-4.0,) * 7, *(0.0,) * 8), 2.0)
ALL_AT_MARGIN = Case("all at the margin, better", (-1.5,) * _CELLS, 1.5)
TWO = Case("one worse by 2 sd", _shifted(1, 2.0), 1.0)
THREE = Case("one worse by 3 sd", _shifted(1, 3.0), 1.0)
CASES = (
    NO_CHANGE,
    NO_CHANGE_WIDE,
    HALF_OF_MARGIN,
    NEAR_MARGIN,
    ONE_AT_MARGIN,
    BETTER_BUT_ONE,
    ALL_AT_MARGIN,
    TWO,
    THREE,
)


def main() -> None:
    """Run the trials and print their rates."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--campaigns", type=int, default=2000)
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    rows = [_row(case, noise, spending, arguments) for spending in Spending for noise in _NOISES for case in CASES]
    _print_levels(SequentialPlan(arguments.repeats, arguments.repeats, {}), 50 * arguments.campaigns)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")


def _print_levels(plan: SequentialPlan, draws: int) -> None:
    """Print how often one sequential rank-sum test rejects where nothing differs, in multiples of its level."""
    rng, levels = np.random.default_rng(1), np.array([0.05, 0.01, 0.01 / _COMPARISONS])
    rejected = np.zeros(len(levels))
    for block in (min(10_000, draws - k) for k in range(0, draws, 10_000)):
        a, b = (rng.standard_normal((block, n)) for n in (plan.repeats_a, plan.most_repeats))
        pairs = np.cumsum((b[:, :, None] > a[:, None, :]).sum(axis=2), axis=1)
        p_values = np.ones(block)
        schedule: tuple[tuple[float, float], ...] = ()
        for n, share in _schedule(plan):
            schedule = (*schedule, (share, share))
            p = _tails(plan.repeats_a, n)[pairs[:, n - 1]]
            p_values = np.minimum(p_values, level_of(p, *sequential_p_table(schedule, plan.spending)))
        rejected += (p_values[:, None] <= levels).sum(axis=0)
    for level, count in zip(levels, rejected, strict=True):
        print(f"one test at {level:.3%}: {count / draws / level:.3f} times its level in {draws} draws")


def _schedule(plan: SequentialPlan) -> list[tuple[int, float]]:
    """Return the repeats of every analysis, and the share of the planned information."""
    most = rank_sum_information(plan.repeats_a, plan.most_repeats)
    due = [n for n in range(1, plan.most_repeats + 1) if plan.is_due(n, n - 1)]
    return [(n, rank_sum_information(plan.repeats_a, n) / most) for n in due]


def _row(case: Case, noise: str, spending: Spending, arguments: argparse.Namespace) -> dict[str, Any]:
    campaigns, repeats = arguments.campaigns, arguments.repeats
    plan = SequentialPlan(repeats, repeats, {}, spending=spending)
    trials = Trials(case, noise, campaigns, plan, arguments.seed)
    stopped = trials.run()
    regression = float(np.mean(stopped.regression))
    row = {
        "spending": str(spending), "noise": noise, "case": case.what, "margin": case.margin, "campaigns": campaigns,
        "seed": arguments.seed,
        "false_difference": _rate(stopped.false_difference), "false_same": _rate(stopped.false_same),
        "regression": regression, "no_regression": float(np.mean(stopped.decided & ~stopped.regression)),
        "regression_once": trials.regression_once(repeats), "mean_repeats": float(np.mean(stopped.repeats)),
    }  # fmt: skip
    if case in (TWO, THREE):
        fixed = trials.fixed_repeats(regression)
        row |= {"fixed_repeats": fixed, "saved": 1.0 - row["mean_repeats"] / fixed}
    _print(row)
    return row


def _rate(outcomes: Floats) -> list[float]:
    found = int(np.sum(outcomes))
    interval = binomtest(found, len(outcomes)).proportion_ci(method="exact")
    return [found / len(outcomes), float(interval.low), float(interval.high)]


def _print(row: dict[str, Any]) -> None:
    false = "  ".join(
        f"false {name} {share:.2%} ({low:.2%} to {high:.2%})"
        for name, (share, low, high) in (("difference", row["false_difference"]), ("same", row["false_same"]))
    )
    print(f"{row['spending']:15} {row['noise']:14} {row['case']:31} margin {row['margin']:g}  {false}", end="  ")
    print(
        f"regression {row['regression']:6.1%} (once {row['regression_once']:6.1%})  none {row['no_regression']:6.1%}",
        end="  ",
    )
    print(f"repeats {row['mean_repeats']:5.2f}", end="")
    print(f"  fixed {row['fixed_repeats']}  saved {row['saved']:.0%}" if "saved" in row else "", flush=True)


@dataclass(frozen=True)
class Stopped:
    """Of every campaign, shape (campaigns,): repeats at its end, what was decided, and whether a verdict was false."""

    repeats: Floats
    decided: Floats
    regression: Floats
    false_difference: Floats
    false_same: Floats


class Trials:
    """Campaigns of one case, drawn once: counts of pairs b > a, b > a + margin and b > a − margin by repeats."""

    def __init__(self, case: Case, noise: str, campaigns: int, plan: SequentialPlan, seed: int) -> None:
        self._case, self._plan, self._campaigns = case, plan, campaigns
        rng = np.random.default_rng(seed)
        draw = rng.standard_normal if noise == "normal" else lambda size: rng.standard_t(3.0, size) / math.sqrt(3.0)
        shifts = np.array(case.shifts)
        self._a = draw((campaigns, _CELLS, plan.repeats_a))
        self._b = draw((campaigns, _CELLS, plan.most_repeats)) + shifts[:, None]
        self._shifts = np.array([*case.shifts, shifts[:_TRAJECTORIES].mean(), shifts[_TRAJECTORIES:].mean()])
        self._pairs = [self._counted(shift) for shift in (0.0, case.margin, -case.margin)]

    def _counted(self, shift: float) -> Floats:
        above = (self._b[:, :, :, None] > self._a[:, :, None, :] + shift).sum(axis=3)
        return np.cumsum(above, axis=2)

    def _p_values(self, repeats: int) -> tuple[Floats, Floats, Floats]:
        """Return p-values of worse, better and the same, (campaigns, comparisons)."""
        plain, above, below = (pairs[:, :, repeats - 1] for pairs in self._pairs)
        n_a = self._plan.repeats_a
        larger, smaller = (_upper(n_a, repeats, plain), _lower(n_a, repeats, plain))
        return larger, smaller, np.maximum(_lower(n_a, repeats, above), _upper(n_a, repeats, below))

    def _differences(self, repeats: int) -> Floats:
        cells = np.median(self._b[:, :, :repeats], axis=2) - np.median(self._a, axis=2)
        means = [cells[:, :_TRAJECTORIES].mean(axis=1), cells[:, _TRAJECTORIES:].mean(axis=1)]
        return np.column_stack([cells, *means])

    def run(self) -> Stopped:
        """Analyse every campaign until it is decided."""
        plan, ended = self._plan, np.zeros(self._campaigns, dtype=bool)
        sequential = [np.ones((self._campaigns, _COMPARISONS)) for _ in range(3)]
        repeats = np.full(self._campaigns, plan.most_repeats)
        regression, false_difference, false_same = (np.zeros_like(ended) for _ in range(3))
        schedule: tuple[tuple[float, float], ...] = ()
        for n, share in _schedule(plan):
            schedule = (*schedule, (share, share))
            table = sequential_p_table(schedule, plan.spending)
            now = [level_of(p, *table) for p in self._p_values(n)]
            sequential = [np.minimum(before, p) for before, p in zip(sequential, now, strict=True)]
            worse, better, same = self._verdicts(sequential, n)
            wrong = (worse & (self._shifts <= 0.0)) | (better & (self._shifts >= 0.0))
            false_difference |= wrong.any(axis=1) & ~ended
            false_same |= (same & (np.abs(self._shifts) >= self._case.margin)).any(axis=1) & ~ended
            ends = (worse.any(axis=1) | (worse | better | same).all(axis=1)) & ~ended
            regression |= worse.any(axis=1) & ends
            repeats[ends] = n
            ended |= ends
        return Stopped(repeats, ended, regression, false_difference, false_same)

    def _verdicts(self, p_values: list[Floats], repeats: int) -> tuple[Floats, Floats, Floats]:
        differences, margin = self._differences(repeats), self._case.margin
        worse = (_holm(p_values[0]) <= self._plan.alpha) & (differences > margin)
        better = (_holm(p_values[1]) <= self._plan.alpha) & (differences < -margin)
        return worse, better, (_hochberg(p_values[2]) <= self._plan.alpha_same) & ~worse & ~better

    def regression_once(self, repeats: int) -> float:
        """Return how often one comparison after so many repeats finds a regression."""
        worse, _, _ = self._verdicts(list(self._p_values(repeats)), repeats)
        return float(np.mean(worse.any(axis=1)))

    def fixed_repeats(self, power: float) -> int:
        """Return the smallest number of repeats that, tested once, finds the regression with this share."""
        for n in range(1, self._plan.most_repeats):
            if self.regression_once(n) >= power:
                return n
        return self._plan.most_repeats


@cache
def _tails(n_a: int, n_b: int) -> Floats:
    """Return P(pairs ≥ k) for k = 0 … n_a n_b if nothing differs, by the recursion of Mann and Whitney (1947)."""
    ways = np.zeros((n_a + 1, n_b + 1, n_a * n_b + 1))
    ways[:, 0, 0] = ways[0, :, 0] = 1.0
    for i in range(1, n_a + 1):
        for j in range(1, n_b + 1):
            ways[i, j] = ways[i - 1, j] * i / (i + j)  # the largest value is one of a: it exceeds no pair
            ways[i, j][i:] += ways[i, j - 1][: n_a * n_b + 1 - i] * j / (i + j)
    # Rows hold P(i of a, j of b, pairs): the weights above are the chances that the largest value is of a or b.
    return np.minimum(1.0, np.cumsum(ways[n_a, n_b][::-1])[::-1])


def _upper(n_a: int, n_b: int, pairs: Floats) -> Floats:
    """Return P(at least so many pairs) of every cell, then of all cells of each quantity together."""
    cells = _tails(n_a, n_b)[pairs]
    sums = [pairs[:, :_TRAJECTORIES].sum(axis=1), pairs[:, _TRAJECTORIES:].sum(axis=1)]
    sd = math.sqrt(_TRAJECTORIES * n_a * n_b * (n_a + n_b + 1) / 12.0)
    together = [ndtr(-(total - _TRAJECTORIES * n_a * n_b / 2.0 - 0.5) / sd) for total in sums]
    return np.column_stack([cells, *together])


def _lower(n_a: int, n_b: int, pairs: Floats) -> Floats:
    """Return P(at most so many pairs)."""
    return _upper(n_a, n_b, n_a * n_b - pairs)


def _holm(p_values: Floats) -> Floats:
    """Return Holm's adjusted p-values of every row."""
    order = np.argsort(p_values, axis=1)
    steps = np.take_along_axis(p_values, order, axis=1) * np.arange(p_values.shape[1], 0, -1)
    return _unsorted(np.maximum.accumulate(steps, axis=1), order)


def _hochberg(p_values: Floats) -> Floats:
    """Return Hochberg's adjusted p-values of every row."""
    order = np.argsort(-p_values, axis=1)
    steps = np.take_along_axis(p_values, order, axis=1) * np.arange(1, p_values.shape[1] + 1)
    return _unsorted(np.minimum.accumulate(steps, axis=1), order)


def _unsorted(ordered: Floats, order: Floats) -> Floats:
    result = np.empty_like(ordered)
    np.put_along_axis(result, order, ordered, axis=1)
    return result


if __name__ == "__main__":
    main()
