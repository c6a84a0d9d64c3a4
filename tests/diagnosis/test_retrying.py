"""A larger model must not be credited with the way that its fit went on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tiny_vehicle import FRONT_M, HEADER, NEUTRAL, REAR_M, Tiny

from agvbench.calibration import measure_run
from agvbench.diagnosis import forms
from agvbench.diagnosis.batch import Batch
from agvbench.diagnosis.candidates import bounds_of, candidates
from agvbench.diagnosis.fitted_models import Scored
from agvbench.diagnosis.fitting import fit
from agvbench.diagnosis.forms import stood_elsewhere
from agvbench.diagnosis.levels import ROLES, free_maps, start_values
from agvbench.diagnosis.prediction import Predictor
from agvbench.diagnosis.reading import read_runs
from agvbench.diagnosis.selection import Selection, Selector
from agvbench.diagnosis.standing import otherwise
from agvbench.vehicle.geometry import Geometry

NO_LIMIT = np.array([[0.0, 5.0]])


@pytest.fixture(scope="module")
def selector(tiny_campaign):
    runs = list(tiny_campaign(Tiny(steering_lag_s=0.15)))
    readings, geometry = read_runs(runs, HEADER.neutral), Geometry(FRONT_M, REAR_M)
    maps = free_maps(readings.runs, NEUTRAL)
    believed = {role: np.zeros(len(maps.nodes[role])) for role in ROLES}
    start = start_values(maps, [measure_run(run, geometry, neutral=NEUTRAL) for run in runs], believed)
    return Selector(Batch(readings, maps, geometry), candidates(), start, 0, lambda _: None)


def test_a_model_left_half_way_is_fitted_again_from_where_the_larger_one_stands(selector):
    lag = selector.grown(selector.base(), "steering_lag")
    bounds = bounds_of(selector.candidates, lag.names)
    begun = fit(Predictor(selector.batch, lag.names), np.r_[selector.start, 0.02], bounds, iterations=1)
    early = Scored(lag.names, begun, begun.loss)
    larger = selector.grown(lag, "lateral_slip")
    again = selector.retried(early, larger)
    assert again.names == lag.names
    assert again.total < early.total - 100.0
    assert again.fit.effect_values()["steering_lag.time_constant_s"] == pytest.approx(0.15, rel=0.03)


def test_a_model_that_is_at_its_best_stays(selector):
    lag = selector.grown(selector.base(), "steering_lag")
    again = selector.retried(lag, selector.grown(lag, "lateral_slip"))
    assert lag.total - 1.0 < again.total <= lag.total


def test_what_is_left_of_a_model_is_not_what_once_ended_elsewhere(selector):
    lag = selector.grown(selector.base(), "steering_lag")
    larger = selector.score(("steering_lag", "lateral_slip"), np.r_[lag.fit.parameters, 0.01], lag.fit)
    poor = fit(Predictor(selector.batch, lag.names), np.r_[selector.start, 0.4], np.array([[0.4, 0.4]]), iterations=8)
    selector._known[lag.names] = Scored(lag.names, poor, poor.loss)
    left, gains = selector.pruned(selector.base(), larger)
    assert left.names == lag.names
    assert list(gains) == ["steering_lag"]
    assert left.total == pytest.approx(lag.total, abs=2.0)


def test_a_rival_is_judged_by_a_fit_that_went_as_far(selector, monkeypatch):
    monkeypatch.setattr("agvbench.diagnosis.selection._NEARLY_RIVAL", np.inf)
    lag = selector.grown(selector.base(), "steering_lag")
    begun = fit(Predictor(selector.batch, lag.names), np.r_[selector.start, 0.1], NO_LIMIT, iterations=1)
    early = Scored(lag.names, begun, begun.loss)
    assert early.total > lag.total + 100.0
    assert abs(selector._worse(early, lag)) < 2.0


@pytest.mark.parametrize(
    ("law", "again"), [("lateral_slip_power", {"steering_lag": 500.0}), ("steering_lag_inertia", {})]
)
def test_what_another_causes_law_replaced_may_be_tried_again(selector, monkeypatch, law, again):
    base = selector.base()
    lag = selector.grown(base, "steering_lag")
    monkeypatch.setattr(forms, "_laws", lambda *_: iter(()))
    monkeypatch.setattr(forms, "_best", lambda _wide, current, _offers: replace(current, names=(law,)))
    monkeypatch.setattr(Selector, "pruned", lambda _self, _base, current: (current, {law: 100.0}))
    reformed = forms.reform(Selection(base, lag, {}, {"steering_lag": 500.0}, {}, 2), selector)
    assert reformed.chosen.names == (law,)
    assert reformed.rejected == again


def test_what_runs_away_is_as_good_as_nothing(selector, monkeypatch):
    def away(*_, **__):
        raise np.linalg.LinAlgError

    fresh = selector.over(selector.batch)
    base = fresh.base()
    monkeypatch.setattr(Selector, "_begun", away)
    lag = fresh.grown(base, "steering_lag")
    assert (lag.names, lag.total) == (("steering_lag",), base.total)
    assert not fresh.earns(base, lag)


def test_where_a_slow_servo_stood_can_be_decided_again(selector):
    right = selector.grown(selector.base(), "steering_lag")
    wrong_belief = otherwise(selector)
    wrong = wrong_belief.grown(wrong_belief.base(), "steering_lag")
    assert stood_elsewhere(wrong, wrong_belief)
    assert not stood_elsewhere(right, selector)
    assert not stood_elsewhere(wrong_belief.base(), wrong_belief)
