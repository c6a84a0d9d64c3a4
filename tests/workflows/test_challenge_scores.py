"""Scores of blind trials, against counts made by hand."""

from __future__ import annotations

import json
import math

import pytest
from scipy.stats import beta

from agvbench.challenge.challenge import run_challenge
from agvbench.challenge.scores import CRITERIA, coverings, score
from agvbench.challenge.trial import Trial
from agvbench.errors import FlagError
from agvbench.statistics.intervals import Proportion


def trial(hidden=(), library=None, verdict="ADEQUATE", named=(), **more):
    library = tuple(hidden) if library is None else tuple(library)
    settings = {"kind": "x", "covariates": (), "absorbed": False, "random_phase": False, "true_parameters": {}} | more
    spec = "_and_".join(hidden) or "nothing"
    return Trial(spec, 0, hidden=tuple(hidden), library_names=library, verdict=verdict, named=tuple(named), **settings)


def shares(*trials):
    return {text: (s.count, s.total) for text, s in score(trials).shares.items()}


ONE, OPEN, OPEN_ALONE, TAKEN_UP, STATIC, NOTHING, WRONG, UNKNOWN, MIXED, TWO = (text for text, _, _ in CRITERIA)


def test_one_hidden_effect_is_right_when_named_or_left_open_among_true_rivals():
    lag = ["steering_lag"]
    found = shares(
        trial(lag, verdict="NAMED", named=lag),
        trial(lag, verdict="NAMED", named=["speed_lag"]),
        trial(lag, verdict="NAMED", named=[*lag, "speed_lag"]),
        trial(lag, verdict="UNKNOWN", named=lag),
        trial(lag, verdict="AMBIGUOUS", named=lag, alternatives=("speed_lag",)),
        trial(lag, verdict="AMBIGUOUS", named=["speed_lag"], alternatives=tuple(lag), rivals=("speed_lag",)),
    )
    assert found[ONE] == (2, 6)
    assert found[OPEN] == (2, 6)
    assert found[OPEN_ALONE] == (1, 5)


def test_another_form_of_a_cause_is_right_under_the_librarys_name():
    assert shares(trial(["lateral_slip_linear"], ["lateral_slip"], "NAMED", ["lateral_slip"]))[ONE] == (1, 1)


def test_names_for_nothing_and_for_what_lies_outside_are_counted_against():
    patch = {"hidden": ["slow_patch"], "library": [], "covariates": ("x_m", "y_m")}
    found = shares(
        trial(), trial(verdict="NAMED", named=["floor_tilt"]),
        trial(**patch, verdict="UNKNOWN", depends_on=("y_m", "speed_mps")),
        trial(**patch, verdict="UNKNOWN", depends_on=("speed_mps", "y_m")),
        trial(**patch, verdict="UNKNOWN", named=["floor_tilt"]),
    )  # fmt: skip
    assert found[STATIC] == found[NOTHING] == (1, 2)
    assert found[WRONG] == (1, 3)
    assert found[UNKNOWN] == (1, 3)


def test_two_must_both_be_named_and_beside_one_from_outside_unknown_said():
    pair = ["steering_lag", "lateral_slip"]
    assert shares(trial(pair, verdict="NAMED", named=pair), trial(pair, verdict="NAMED", named=pair[:1]))[TWO] == (1, 2)
    mixed = (["steering_lag", "slow_patch"], ["steering_lag"])
    found = shares(
        trial(*mixed, "UNKNOWN", ["steering_lag"]), trial(*mixed, "NAMED", ["steering_lag"]), trial(*mixed, "UNKNOWN")
    )
    assert found[MIXED] == (1, 3)


def test_what_free_maps_take_up_is_not_asked_for_by_name():
    found = shares(trial(["mocap_scale"], absorbed=True))
    assert found[ONE] == (0, 0)
    assert found[TAKEN_UP] == (0, 1)


@pytest.mark.parametrize(("count", "total"), [(0, 20), (7, 20), (20, 20)])
def test_bounds_are_exact(count, total):
    share = Proportion.of([True] * count + [False] * (total - count))
    assert share.low == pytest.approx(beta.ppf(0.025, count, total - count + 1) if count else 0.0)
    assert share.high == pytest.approx(beta.ppf(0.975, count + 1, total - count) if count < total else 1.0)


def test_intervals_cover_or_not_and_directions_are_compared_on_the_circle():
    tilt = trial(
        ["floor_tilt"], verdict="NAMED", named=["floor_tilt"],
        true_parameters={"floor_tilt": {"drift_mps": 0.010, "direction_rad": 3.1}, "other": {"a": 1.0}},
        estimates={"floor_tilt": {"drift_mps": (0.013, 0.001), "direction_rad": (-3.15, 0.05)}},
    )  # fmt: skip
    assert coverings(tilt) == [False, True]


def test_removed_error_is_what_lies_above_the_floor():
    good = trial(["steering_lag"], squares_mm2={"before": 101.0, "after": 2.0, "floor": 1.0})
    level = trial(["steering_lag"], squares_mm2={"before": 1.1, "after": 1.0, "floor": 1.0})
    assert good.removed == pytest.approx(0.99)
    assert math.isnan(level.removed)
    assert score([good, level]).removed["inside the library"] == pytest.approx((0.99, 0.99))


def test_a_size_that_leaves_less_than_three_floors_is_counted_with_all_and_not_beside_those_that_leave_them():
    small = trial(["steering_backlash"], squares_mm2={"before": 28.5, "after": 10.3, "floor": 6.8})
    large = trial(["steering_lag"], squares_mm2={"before": 108.8, "after": 7.8, "floor": 6.8})
    found = score([small, large]).removed
    assert found["inside the library"] == pytest.approx((18.2 / 21.7, 0.5 * (18.2 / 21.7 + 101.0 / 102.0)))
    assert found["inside the library, free maps left three floors"] == pytest.approx((101.0 / 102.0,) * 2)


def test_the_scores_of_four_trials_are_those_counted_by_hand():
    held = [{"before": 101.0, "after": 1.0 + 100.0 * left, "floor": 1.0} for left in (0.8, 0.1, 0.01)]
    told = {"true_parameters": {"steering_lag": {"time_constant_s": 0.1}}}
    lag = ["steering_lag"]
    found = score([
        trial(lag, verdict="NAMED", named=lag, squares_mm2=held[0], seconds=4.0, **told,
              estimates={"steering_lag": {"time_constant_s": (0.13, 0.01)}}),
        trial(lag, verdict="AMBIGUOUS", named=lag, alternatives=("mocap_latency", "speed_lag"), seconds=10.0, **told,
              squares_mm2=held[1], estimates={"steering_lag": {"time_constant_s": (0.11, 0.01)}}),
        trial(lag, verdict="NAMED", named=lag, squares_mm2=held[2], worse_on=("5",), seconds=6.0),
        trial(seconds=1.0),
    ])  # fmt: skip
    assert found.removed["inside the library"] == pytest.approx((0.2, 0.9))
    assert found.list_length == 3.0
    assert (found.coverage.count, found.coverage.total) == (1, 2)
    assert found.worse_on == 1
    assert found.seconds == (5.0, 10.0)


def test_removed_error_is_not_asked_for_where_free_maps_leave_none():
    good = trial(["steering_lag"], squares_mm2={"before": 101.0, "after": 2.0, "floor": 1.0})
    taken_up = trial(["mocap_scale"], absorbed=True, squares_mm2={"before": 2.0, "after": 2.0, "floor": 1.0})
    assert score([good, taken_up]).removed["inside the library"] == pytest.approx((0.99, 0.99))


def test_json_has_no_nan():
    text = json.dumps(score([trial()]).to_json(), allow_nan=False)
    assert json.loads(text)["confusion"] == {"nothing": {"ADEQUATE": 1}}


@pytest.mark.parametrize(
    ("flag", "wrong"),
    [
        ("--seeds", {"seeds": 0}),
        ("--first-seed", {"first_seed": -1}),
        ("--jobs", {"jobs": -1}),
        ("--jobs", {"jobs": 0}),
        ("--only", {"specs": ["steering_leg"]}),
    ],
)
def test_bad_flags_are_told(flag, wrong):
    right = {"seeds": 1, "first_seed": 0, "specs": [], "repeats": 5, "jobs": 1, "json_file": None}
    with pytest.raises(FlagError, match=flag):
        run_challenge(**(right | wrong))
