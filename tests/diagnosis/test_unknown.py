"""Structure that no effect explains: what it depends on, by chance or not, and the term that describes it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from histories import history_of
from tiny_vehicle import FRONT_M, REAR_M, Tiny, campaign_runs

from agvbench.diagnosis import Verdict, diagnose, terms
from agvbench.diagnosis.checks.consistency import require_consistent_repeats
from agvbench.diagnosis.criteria import RESIDUAL
from agvbench.diagnosis.data.readings import read_runs
from agvbench.diagnosis.discrepancy.campaign_time import by_axle_angles
from agvbench.diagnosis.discrepancy.regression import FOLDS, GroupedRegression
from agvbench.diagnosis.discrepancy.screening import Start, screen
from agvbench.diagnosis.discrepancy.shapes import Evidence, every_shape
from agvbench.diagnosis.residuals.body_rates import LoggedSteps, Rates
from agvbench.diagnosis.residuals.covariate_test import RANDOM_PHASE, dependences
from agvbench.diagnosis.residuals.periodic import periodic_disturbance
from agvbench.diagnosis.selection.with_term import gain_p_value
from agvbench.errors import CampaignError
from agvbench.vehicle.geometry import Geometry

RUNS, STEPS, REPEATS = 60, 20, 3
GEOMETRY = Geometry(FRONT_M, REAR_M)
GROUP = np.repeat(np.arange(RUNS // REPEATS), REPEATS)


def drives(seed: int, *, variance_components: float = 0.01) -> Rates:
    """Return rates of straight drives over the floor that miss by chance: runs by themselves, and each step."""
    rng = np.random.default_rng(seed)
    size, per_run = 0.1, (RUNS, STEPS)
    start, heading = rng.uniform(-1.0, 1.0, (RUNS, 2)), rng.uniform(-math.pi, math.pi, RUNS)
    way = size * np.arange(STEPS + 1)
    places = start[:, None] + way[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])[:, None]
    begin = np.dstack([places[:, :-1], np.broadcast_to(heading[:, None], per_run)]).reshape(-1, 3)
    end = np.dstack([places[:, 1:], np.broadcast_to(heading[:, None], per_run)]).reshape(-1, 3)
    run = np.repeat(np.arange(RUNS), STEPS)
    value = rng.normal(0.0, variance_components, (RUNS, 1, 3)) + rng.normal(0.0, variance_components, (*per_run, 3))
    distance = np.tile(0.5 * (way[1:] + way[:-1]), RUNS)
    one = np.ones(RUNS * STEPS)
    covariates = {
        "x_m": 0.5 * (begin + end)[:, 0],
        "y_m": 0.5 * (begin + end)[:, 1],
        "heading_rad": np.mod(begin[:, 2], math.tau),
        "course_rad": np.mod(begin[:, 2] + np.repeat(np.where(np.arange(RUNS) % 2, 0.0, math.pi), STEPS), math.tau),
        "time_in_run_s": distance / 0.3,
        "campaign_time_h": np.repeat(np.linspace(0.0, 1.0, RUNS), STEPS),
        "speed_mps": 0.3 * one,
        "direction": np.repeat(np.where(np.arange(RUNS) % 2, 1.0, -1.0), STEPS),
        "curvature_per_m": 0.0 * one,
        "sideslip": 0.0 * one,
        "distance_m": distance,
    }
    return Rates(run, value.reshape(-1, 3), size * one, covariates, begin, end, np.tile(np.arange(STEPS), RUNS))


def screened(rates: Rates) -> list[Start]:
    straight = np.zeros((len(rates.run), 2))
    return screen(rates, history_of(straight, straight), GEOMETRY, GROUP, 0)


def test_chance_is_rarely_called_a_dependence():
    p_values = [d.p_value for seed in range(12) for d in dependences(drives(seed), GROUP, seed)]
    assert len(p_values) <= 1  # at a level of one in a thousand


def test_a_dependence_is_found_with_its_covariate_first():
    rates = drives(1)
    rates.value[:, 0] += 0.04 * np.sin(2.0 * rates.covariates["x_m"])
    (first, *_) = dependences(rates, np.arange(RUNS), 0)
    assert (first.covariate, first.feature) == ("x_m", "speed")
    assert first.p_value < RESIDUAL.dependence_alpha


def test_what_pulls_towards_a_place_is_a_drift_that_depends_on_it():
    rates = drives(7)
    away = rates.middle - np.array([0.3, -0.2])
    pull = np.where(np.hypot(*away.T) < 0.8, 0.04 / np.maximum(np.hypot(*away.T), 1e-9), 0.0)
    cos, sin = np.cos(rates.begin[:, 2]), np.sin(rates.begin[:, 2])
    dx, dy = -(pull[:, None] * away * rates.covariates["direction"][:, None]).T
    rates.value[:, 0] += cos * dx + sin * dy
    rates.value[:, 1] += cos * dy - sin * dx
    assert rates.drift.shape == (RUNS * STEPS, 2)
    elsewhere = rates.begin[::STEPS]
    found = dependences(rates, GROUP, 0, elsewhere)
    assert sorted((d.covariate, d.feature) for d in found) == [("x_m", "drift"), ("y_m", "drift")]
    # Repeats that began alike are one piece of evidence, of which these are too few.
    assert dependences(rates, GROUP, 0, np.zeros_like(elsewhere)) == dependences(rates, GROUP, 0) == []
    assert dependences(drives(7), GROUP, 0, elsewhere) == []


def test_where_structure_is_known_to_remain_what_is_likely_is_found_too():
    rates = drives(1)
    rates.value[:, 0] += 0.012 * np.sin(2.0 * rates.covariates["x_m"])
    assert dependences(rates, GROUP, 0) == []
    (likely,) = dependences(rates, GROUP, 0, alpha=RESIDUAL.likely_alpha)
    assert (likely.covariate, likely.feature) == ("x_m", "speed")
    assert RESIDUAL.dependence_alpha < likely.p_value < RESIDUAL.likely_alpha


@pytest.mark.parametrize("period", [0.3, 0.45])
def test_a_swing_with_another_phase_in_each_run_is_a_matter_of_distance(period):
    rates = drives(2)
    assert periodic_disturbance(rates, GROUP, 0) is None
    # What repeats have in common has no phase of its own.
    same = dataclasses.replace(rates, value=rates.value.copy())
    same.value[:, 2] += 0.05 * np.sin(math.tau * rates.covariates["distance_m"] / period)
    assert periodic_disturbance(same, GROUP, 0) is None
    phase = np.random.default_rng(3).uniform(0.0, math.tau, RUNS)[rates.run]
    wave = np.sin(math.tau * rates.covariates["distance_m"] / period + phase)
    # Nor do a few runs that miss by far make a swing of all.
    loud = dataclasses.replace(rates, value=rates.value.copy())
    loud.value[:, 2] += 3.0 * wave * (rates.run < 4)
    assert periodic_disturbance(loud, GROUP, 0) is None
    rates.value[:, 2] += 0.05 * wave
    found = periodic_disturbance(rates, GROUP, 0)
    assert found is not None
    assert (found.covariate, found.feature) == (RANDOM_PHASE, "turning")
    assert found.share > 0.5


def test_a_slow_disc_is_found_where_it_lies():
    rates = drives(4)
    inside = np.hypot(rates.middle[:, 0] - 0.4, rates.middle[:, 1] + 0.3) < 0.5
    rates.value[:, 0] -= 0.2 * inside
    (best, *_) = screened(rates)
    assert best.term is terms.SpeedInDisc
    loss, x, y, radius = best.values[0]
    assert loss == pytest.approx(0.2, rel=0.2)
    assert math.hypot(x - 0.4, y + 0.3) < 0.25  # within reach of a fit: the grid is coarse
    assert radius == pytest.approx(0.5, abs=0.2)


def test_a_slow_strip_is_found_where_it_lies():
    rates = drives(6)
    across = rates.middle[:, 0] * math.cos(2.0) + rates.middle[:, 1] * math.sin(2.0)
    rates.value[:, 0] -= 0.2 * (np.abs(across - 0.3) < 0.5)
    (best, *_) = screened(rates)
    assert best.term is terms.SpeedInStrip
    loss, place, direction, width = best.values[0]
    assert loss == pytest.approx(0.2, rel=0.2)
    assert place == pytest.approx(0.3, abs=0.15)
    assert direction == pytest.approx(2.0, abs=0.2)
    assert width == pytest.approx(1.0, abs=0.4)


def test_a_line_that_turns_is_found_where_it_lies():
    rates = drives(5)
    crossed = (rates.end[:, 0] > 0.2).astype(float) - (rates.begin[:, 0] > 0.2)
    rates.value[:, 2] += 0.04 * crossed * rates.covariates["direction"] / rates.weight
    (best, *_) = screened(rates)
    assert best.term is terms.TurnAtLine
    turn, same, place, direction = best.values[0]
    assert abs(same) < 0.01
    assert direction == pytest.approx(0.0, abs=0.01)
    assert place == pytest.approx(0.2, abs=0.06)
    assert turn == pytest.approx(0.04, rel=0.25)


def test_chance_promises_no_term():
    assert all(start.gain < 4.0 for seed in range(3) for start in screened(drives(seed)))


def test_the_p_value_of_a_gain_counts_groups_and_not_runs():
    one_group = np.where(GROUP == 0, 50.0, 0.0)
    assert gain_p_value(one_group, GROUP, 0) > 0.4
    assert gain_p_value(np.ones(RUNS), GROUP, 0) < 1e-3


def test_frames_that_do_not_belong_to_their_commands_are_one_line():
    runs = campaign_runs(Tiny())
    require_consistent_repeats(read_runs(runs), where="campaign tiny")
    order = np.random.default_rng(0).permutation(len(runs))
    mixed = [dataclasses.replace(run, frames=runs[k].frames) for run, k in zip(runs, order, strict=True)]
    with pytest.raises(CampaignError, match="same commands contradict each other") as error:
        require_consistent_repeats(read_runs(mixed), where="campaign tiny")
    assert "\n" not in str(error.value)


def test_repeats_that_were_lost_half_way_do_not_contradict_the_others():
    runs = campaign_runs(Tiny())
    ends = [0.5 * float(run.frames.t_s[-1]) if k % 2 else np.inf for k, run in enumerate(runs)]
    cut = [
        dataclasses.replace(run, frames=run.frames.select(run.frames.t_s < end))
        for run, end in zip(runs, ends, strict=True)
    ]
    readings = read_runs(cut)
    lasted_s = readings.t_s[:, -1]
    assert np.count_nonzero(lasted_s < 0.6 * np.max(lasted_s)) > len(cut) // 4
    require_consistent_repeats(readings, where="campaign tiny")
    assert len(readings) == len(runs)


@pytest.mark.slow
def test_a_disc_beside_a_lag_is_counted_in_what_is_predicted_after(tiny_campaign):
    found = diagnose(tiny_campaign(Tiny(slow_patch=0.15, steering_lag_s=0.15)))
    assert found.verdict is Verdict.UNKNOWN
    assert [effect.name for effect in found.effects] == ["steering_lag"]
    assert found.depends_on[0].covariate in {"x_m", "y_m"}
    term = found.provenance["empirical_term"]
    assert term["name"] == "speed_in_disc"
    assert term["parameters"]["loss"] == pytest.approx(0.15, rel=0.15)
    assert term["parameters"]["radius_m"] == pytest.approx(0.7, rel=0.1)
    position = found.held_out.errors["position_rms_mm"]
    assert position["after"] < 1.5 * position["floor"] < 0.2 * position["before"]


def seam(rates: Rates, *, turn_rad: float, place_m: float, direction_rad: float) -> Rates:
    across = np.array([math.cos(direction_rad), math.sin(direction_rad)])
    before, after = (p[:, :2] @ across > place_m for p in (rates.begin, rates.end))
    kicks = np.zeros_like(rates.value)
    kicks[:, 2] = turn_rad * (after.astype(float) - before) * rates.covariates["direction"] / rates.weight
    return dataclasses.replace(rates, value=rates.value + kicks)


def test_a_seam_between_the_directions_tried_is_found_though_one_run_went_astray():
    rates = seam(drives(3), turn_rad=0.06, place_m=0.3, direction_rad=-0.14)
    rates.value[100, 2] += 20.0
    found = next(start for start in screened(rates) if start.term is terms.TurnAtLine)
    turn_rad, same_rad, place_m, direction_rad = found.values[0]
    assert abs(same_rad) < 0.02
    if math.cos(direction_rad) < 0.0:
        turn_rad, place_m, direction_rad = -turn_rad, -place_m, direction_rad - math.pi
    assert turn_rad == pytest.approx(0.06, abs=0.02)
    assert place_m == pytest.approx(0.3, abs=0.05)
    assert math.remainder(direction_rad + 0.14, math.tau) == pytest.approx(0.0, abs=0.1)


@pytest.mark.slow
def test_steering_that_warms_up_within_the_session_is_described_by_campaign_time(tiny_campaign):
    found = diagnose(tiny_campaign(Tiny(warm_gain=0.2)))
    assert found.verdict is Verdict.UNKNOWN
    assert found.effects == ()
    assert found.depends_on[0].covariate == "campaign_time_h"
    assert found.provenance["empirical_term"]["parameters"]["gain"] == pytest.approx(0.2, rel=0.1)
    position = found.held_out.errors["position_rms_mm"]
    assert position["after"] < 0.3 * position["before"]


@pytest.mark.slow
def test_a_battery_that_is_changed_half_way_is_a_drift_that_starts_over(tiny_campaign):
    found = diagnose(tiny_campaign(Tiny(droop_per_hour=0.1, battery_changed_h=0.5)))
    assert found.verdict is Verdict.UNKNOWN
    assert found.depends_on[0].covariate == "campaign_time_h"
    term = found.provenance["empirical_term"]
    assert term["name"] == "speed_by_campaign_time"
    assert term["parameters"]["begins_h"] == pytest.approx(0.5, abs=0.01)
    per_hour = term["parameters"]["change"] / term["parameters"]["time_constant_h"]
    assert per_hour == pytest.approx(-0.1, rel=0.15)
    position = found.held_out.errors["position_rms_mm"]
    assert position["after"] < 0.5 * position["before"]


@pytest.mark.slow
def test_servos_that_are_slow_while_they_are_cold_are_named_with_their_change(tiny_campaign):
    found = diagnose(tiny_campaign(Tiny(cold_steering_lag_s=0.4)))
    assert found.verdict is Verdict.UNKNOWN
    assert [effect.name for effect in found.effects] == ["steering_lag"]
    term = found.provenance["empirical_term"]
    assert term["name"] == "steering_lag_by_campaign_time"
    assert term["parameters"]["change_s"] == pytest.approx(-0.4, rel=0.1)
    assert term["parameters"]["time_constant_h"] == pytest.approx(0.4, rel=0.2)
    position = found.held_out.errors["position_rms_mm"]
    assert position["after"] < 0.3 * position["before"]


def test_every_term_has_a_shape_that_is_screened():
    rates, straight = drives(1), np.zeros((RUNS * STEPS, 2))
    turned = history_of(straight + 0.1, straight)
    logged = dataclasses.replace(rates, standardised=np.linspace(-1.0, 1.0, RUNS * STEPS)[:, None])
    regression = GroupedRegression(rates, turned, np.arange(RUNS * STEPS) % FOLDS)
    screened_terms = {
        term
        for geometry in (GEOMETRY, Geometry(0.0, 0.05, kinematics="differential"))
        for term, _ in every_shape(Evidence(logged, turned, geometry, regression))
    }
    assert screened_terms == set(terms.TERMS)


def test_maps_of_a_front_axle_do_not_absorb_what_the_rear_axle_does():
    """A rear axle that turns with the front command has another lateral velocity, and no map of the front axle."""
    rates, rear_m = drives(5), GEOMETRY.rear_axle_m
    side = np.where(GROUP % 2, 1.0, -1.0)[rates.run]
    levels = np.column_stack([np.zeros_like(rates.run), GROUP[rates.run] % 2, np.zeros_like(rates.run)])
    history = history_of(0.1 * np.column_stack([side, 0.0 * side]), np.zeros((len(side), 2)), levels)
    columns = by_axle_angles(side, side, history, GEOMETRY)
    of_front, of_rear = ({k: c[:, [axle]] for k, c in columns.items()} for axle in (0, 1))
    for moved, is_seen in ((of_front, False), (of_rear, True)):
        value = rates.value + 0.02 * np.column_stack([0.0 * side, moved[1], moved[2]])
        regression = GroupedRegression(
            dataclasses.replace(rates, value=value), history, GROUP[rates.run] % FOLDS, rear_m
        )
        gain, (size,) = regression.gain(of_rear)
        assert (gain > 10.0) is is_seen
        assert size == pytest.approx(0.02 if is_seen else 0.0, abs=0.003)


def test_steps_of_one_group_show_no_dependence():
    """A vehicle that only turns on the spot beside one straight run has steps of some length in that group alone."""
    assert dependences(drives(0), np.zeros(RUNS, dtype=np.int64), 0) == []


@pytest.mark.parametrize("logged_runs", [0, REPEATS])
def test_a_column_that_few_runs_or_none_have_is_no_covariate(logged_runs):
    rates = drives(0)
    value = np.where(rates.run < logged_runs, rates.run + 20.0, np.nan)
    columns = {"temperature_C": LoggedSteps(value, is_text=False)}
    assert dependences(dataclasses.replace(rates, logged=columns), GROUP, 0) == []


def test_runs_without_a_step_that_is_long_enough_have_no_dependence_and_no_term():
    rates, names = drives(0), ("run", "value", "weight", "begin", "end", "step")
    covariates = {name: values[:0] for name, values in rates.covariates.items()}
    empty = Rates(**{name: getattr(rates, name)[:0] for name in names}, covariates=covariates)
    assert dependences(empty, GROUP, 0) == []
    assert screened(empty) == []
