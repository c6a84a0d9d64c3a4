"""Sequential comparisons: what is decided when, and how often that is wrong, on drawn campaigns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom
from statistics_samples import error_table

from agvbench.statistics import ComparisonVerdict
from agvbench.statistics.differences import ALL
from agvbench.statistics.hypothesis_tests import hochberg, rank_test
from agvbench.statistics.matching import match_cells
from agvbench.statistics.quantities import END_POSE
from agvbench.statistics.repeats.group_sequential import rank_sum_information
from agvbench.statistics.repeats.sequential import (
    Analysis,
    Decision,
    Observation,
    SequentialPlan,
    analyse,
    compared_keys,
    decision,
    verdicts,
)

PLACES = (("1_forward", "calibrated"), ("5_forward_left", "calibrated"))
PLAN = SequentialPlan(12, 12, {"position_mm": 6.0, "delta_heading_deg": 1.0})
POSITION = "position_mm"


def campaigns(seed, *, shift=(), sd=2.0, repeats=12):
    rng = np.random.default_rng(seed)
    names = [trajectory for trajectory, _ in PLACES]
    base = dict.fromkeys(PLACES, (50.0, 5.0))
    return [
        error_table(
            lambda size: rng.normal(0.0, sd, size), repeats=repeats, trajectories=names, conditions=("calibrated",),
            shift=base | dict(moved),
        )
        for moved in ((), shift)
    ]  # fmt: skip


def analysed(a, b, plan=PLAN, places=PLACES):
    """Analyse after each round of repeats until the comparison is decided; return the analyses."""
    made = []
    for n in range(1, plan.most_repeats + 1):
        if plan.is_due(n, made[-1].repeats if made else 0):
            cells, _ = match_cells(a, b[b["repeat"] < n], conditions=None, same_campaign=False, quantities=END_POSE)
            made.append(analyse(cells, places, plan, n))
            if decision(verdicts(made, plan)) is not Decision.OPEN:
                break
    return made


def test_equal_campaigns_are_the_same_before_the_last_repeat():
    made = analysed(*campaigns(1))
    assert {v.verdict for v in verdicts(made, PLAN)} == {ComparisonVerdict.SAME}
    assert decision(verdicts(made, PLAN)) is Decision.NO_REGRESSION
    assert made[-1].repeats < 12


def test_a_regression_is_found_and_ends_the_comparison():
    made = analysed(*campaigns(2, shift={PLACES[0]: (70.0, 5.0)}))
    assert decision(verdicts(made, PLAN)) is Decision.REGRESSION
    assert made[-1].repeats < 12
    worse = [v.key for v in verdicts(made, PLAN) if v.verdict is ComparisonVerdict.WORSE]
    assert {key[0] for key in worse} <= {PLACES[0][0], ALL}
    assert all(key[2] == POSITION for key in worse)


def test_an_improvement_is_no_regression():
    made = analysed(*campaigns(3, shift=dict.fromkeys(PLACES, (20.0, 5.0))))
    better = [v.key for v in verdicts(made, PLAN) if v.verdict is ComparisonVerdict.BETTER]
    assert {key[2] for key in better} == {POSITION}
    assert decision(verdicts(made, PLAN)) is Decision.NO_REGRESSION


def test_noise_as_large_as_the_margin_decides_nothing():
    made = analysed(*campaigns(4, sd=8.0))
    assert made[-1].repeats == 12
    assert decision(verdicts(made, PLAN)) is Decision.OPEN


def test_each_place_is_compared_alone_and_several_together():
    assert compared_keys(PLACES[:1]) == [(*PLACES[0], POSITION), (*PLACES[0], "delta_heading_deg")]
    assert compared_keys(PLACES)[-2:] == [(ALL, "all", POSITION), (ALL, "all", "delta_heading_deg")]


def test_a_place_without_a_run_that_counts_stays_open():
    a, b = campaigns(1)
    driven = b[b["trajectory"] == PLACES[0][0]]
    made = analysed(a, driven)
    found = {v.key: v for v in verdicts(made, PLAN)}
    assert list(found) == compared_keys(PLACES)
    assert found[(*PLACES[1], POSITION)].is_open
    assert decision(verdicts(made, PLAN)) is Decision.OPEN


def test_the_share_of_information_follows_from_the_repeats_that_count():
    a, b = campaigns(1)
    cells, _ = match_cells(a, b[b["repeat"] < 5], conditions=None, same_campaign=False, quantities=END_POSE)
    shares = {o.key: o.information for o in analyse(cells, PLACES, PLAN, 5).observations}
    expected = rank_sum_information(12, 5) / rank_sum_information(12, 12)
    assert list(shares.values()) == pytest.approx([expected] * len(shares))


def test_analyses_are_due_from_the_third_round_and_at_the_last():
    def due(plan):
        made = [0]
        for n in range(1, plan.most_repeats + 1):
            if plan.is_due(n, made[-1]):
                made.append(n)
        return made[1:]

    assert due(replace(PLAN, most_repeats=6)) == [3, 4, 5, 6]
    assert due(replace(PLAN, most_repeats=2)) == [2]
    many = due(replace(PLAN, most_repeats=400))
    assert len(many) < 80  # one more repeat hardly adds information when A has 12
    assert many[-1] == 400


# What follows draws comparisons without trajectories, so that it can be repeated often.


def drawn(rng, shifts, margin, plan):
    """Return the analyses of independent comparisons with these shifts, in standard deviations."""
    a = rng.standard_normal((len(shifts), plan.repeats_a))
    b = rng.standard_normal((len(shifts), plan.most_repeats)) + np.array(shifts)[:, None]
    most = rank_sum_information(plan.repeats_a, plan.most_repeats)
    made = []
    for n in range(plan.fewest_repeats, plan.most_repeats + 1):
        share = rank_sum_information(plan.repeats_a, n) / most
        found = [_observation(k, a[k], b[k, :n], margin, share) for k in range(len(shifts))]
        made.append(Analysis(n, tuple(found)))
    return made


def _observation(k, a, b, margin, share):
    plain, above, below = (rank_test([(a + shift, b)]) for shift in (0.0, margin, -margin))
    p_values = plain.p_greater, plain.p_less, max(above.p_less, below.p_greater)
    return Observation((str(k), "", POSITION), len(a), len(b), share, np.median(b) - np.median(a), *p_values)


def wrong_verdicts(shifts, margin, wrong, count=150):
    """Return in how many comparisons a verdict among `wrong` was given at any analysis, and the plan."""
    plan = SequentialPlan(8, 10, {POSITION: margin}, alpha=0.1, alpha_same=0.1)
    rng = np.random.default_rng(11)
    found = 0
    for _ in range(count):
        made = drawn(rng, shifts, margin, plan)
        given = [v.verdict for k in range(1, len(made) + 1) for v in verdicts(made[:k], plan)]
        found += any(verdict in wrong for verdict in given)
    return found, binom.ppf(0.999, count, 0.1)


def test_false_differences_over_all_comparisons_and_analyses():
    found, highest = wrong_verdicts([0.0] * 3, 0.1, {ComparisonVerdict.WORSE})
    assert 0 < found <= highest


@pytest.mark.parametrize("shifts", [[1.5] * 3, [1.5, -1.5]])
def test_false_equivalence_at_the_margin_over_all_comparisons_and_analyses(shifts):
    found, highest = wrong_verdicts(shifts, 1.5, {ComparisonVerdict.SAME})
    assert 0 < found <= highest


def test_hochberg_rejects_all_where_all_are_significant():
    assert hochberg([0.05, 0.04, 0.05]) == pytest.approx([0.05, 0.05, 0.05])
    assert hochberg([0.9, 0.02, 0.03]) == pytest.approx([0.9, 0.06, 0.06])
