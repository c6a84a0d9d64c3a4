"""How many repeats decide: the planned numbers keep their power in comparisons of drawn campaigns."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binom

from agvbench.errors import FlagError, InputError
from agvbench.statistics import ComparisonVerdict, compare_errors
from agvbench.statistics.repeats.sample_size import plan_repeats, power_of_same, power_of_worse

_TRAJECTORIES = ("1", "5", "6")


def _errors(rng, repeats, *, sd_mm=4.0, grown_mm=0.0):
    """Return a table of errors of three trajectories; the end position error of "5" has grown."""
    rows = []
    for trajectory in _TRAJECTORIES:
        position = rng.normal(40.0, sd_mm, repeats) + (grown_mm if trajectory == "5" else 0.0)
        for k in range(repeats):
            heading, distance = rng.normal(5.0, 0.3), rng.normal(20.0, 1.0)
            named = {"trajectory": trajectory, "condition": "calibrated", "session": "", "status": "ok", "problem": ""}
            target = {"target_x_m": 1.0, "target_y_m": 1.0, "target_heading_rad": 0.0}
            numbers = {"position_mm": position[k], "delta_heading_deg": heading, "delta_s_mm": distance}
            rows.append(
                {**named, **target, **numbers, "along_mm": 0.0, "across_mm": 0.0, "run_id": f"{trajectory}-{k}"}
            )
    return pd.DataFrame(rows)


def _planned(errors, **options):
    return {(p.trajectory, p.quantity.column): p for p in plan_repeats(errors, **options)}


@pytest.mark.slow
def test_the_planned_number_finds_a_growth_of_two_margins_as_often_as_promised():
    found = _planned(_errors(np.random.default_rng(1), 40))["5", "position_mm"]
    trials, worse = 60, 0
    for seed in range(trials):
        rng = np.random.default_rng(100 + seed)
        a, b = _errors(rng, found.worse), _errors(rng, found.worse, grown_mm=10.0)
        compared = compare_errors(a, b, resamples=50)
        worse += any(
            d.trajectory == "5" and d.quantity.column == "position_mm" for d in compared.of(ComparisonVerdict.WORSE)
        )
    assert worse >= binom.ppf(0.005, trials, 0.9)


def test_the_planned_number_shows_the_same_as_often_as_promised():
    found = _planned(_errors(np.random.default_rng(2), 40))["5", "position_mm"]
    trials, same = 40, 0
    for seed in range(trials):
        rng = np.random.default_rng(500 + seed)
        compared = compare_errors(_errors(rng, found.same), _errors(rng, found.same), resamples=50)
        same += any(
            d.trajectory == "5" and d.quantity.column == "position_mm" for d in compared.of(ComparisonVerdict.SAME)
        )
    assert same >= binom.ppf(0.005, trials, 0.9)


def test_more_noise_and_smaller_margins_need_more_repeats():
    quiet, loud = (_errors(np.random.default_rng(3), 20, sd_mm=sd) for sd in (2.0, 8.0))
    few, many = (_planned(errors)["5", "position_mm"] for errors in (quiet, loud))
    assert few.worse < many.worse
    assert few.same < many.same
    assert _planned(quiet, margin_mm=1.0)["5", "position_mm"].worse > few.worse
    assert _planned(quiet, power=0.99)["5", "position_mm"].worse >= few.worse


def test_what_no_affordable_number_shows_has_none():
    errors = _errors(np.random.default_rng(4), 10, sd_mm=100.0)
    assert _planned(errors)["5", "position_mm"].worse is None


def test_power_rises_with_repeats():
    assert power_of_worse(30, 2.0, 1.0, 0.001) > power_of_worse(10, 2.0, 1.0, 0.001)
    assert power_of_same(60, 1.0) > power_of_same(10, 1.0)


def test_bad_input_is_refused():
    errors = _errors(np.random.default_rng(5), 5)
    with pytest.raises(FlagError, match=r"0\.5 to 0\.999"):
        plan_repeats(errors, power=1.5)
    with pytest.raises(FlagError, match=r"margin of 0"):
        plan_repeats(errors, margin_mm=0.0)
    with pytest.raises(InputError, match="no trajectory has two repeats"):
        plan_repeats(_errors(np.random.default_rng(6), 1))
