"""A larger model must not be credited with the way that its fit went on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tiny_vehicle import FRONT_M, HEADER, NEUTRAL_COMMAND, REAR_M, Tiny

from agvbench.diagnosis.criteria import FIT
from agvbench.diagnosis.data.readings import read_runs
from agvbench.diagnosis.discrepancy import stepwise as empirical
from agvbench.diagnosis.estimation.levenberg_marquardt import (
    Convergence,
    FitState,
    LevenbergMarquardt,
    Step,
    StepSolver,
)
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.nodal_maps import ROLES, nodal_maps
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.model.steady_drives import start_values, steady_drives
from agvbench.diagnosis.selection import variants as forms
from agvbench.diagnosis.selection.candidates import candidates, default_candidate
from agvbench.diagnosis.selection.initial_steering import under_other_initial_steering
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.variants import prefers_other_initial_steering, with_extended_library
from agvbench.diagnosis.selection.with_term import SelectedTerm, TermSelection
from agvbench.diagnosis.terms import SpeedInDisc
from agvbench.vehicle.geometry import Geometry

NO_LIMIT = np.array([[0.0, 5.0]])


@pytest.fixture(scope="module")
def selector(tiny_campaign):
    runs = list(tiny_campaign(Tiny(steering_lag_s=0.15)))
    readings, geometry = read_runs(runs, HEADER.neutral), Geometry(FRONT_M, REAR_M)
    maps = nodal_maps(readings.runs, NEUTRAL_COMMAND)
    prior_model = {role: np.zeros(len(maps.nodes[role])) for role in ROLES}
    start = start_values(maps, steady_drives(runs, geometry, NEUTRAL_COMMAND), prior_model)
    return Selector(Batch(readings, maps, geometry), candidates(geometry), start, 0, lambda _: None)


@pytest.mark.parametrize(
    ("law", "again"), [("lateral_slip_power", {"steering_lag": 500.0}), ("steering_lag_inertia", {})]
)
def test_what_another_causes_law_replaced_may_be_tried_again(selector, monkeypatch, law, again):
    base = selector.base()
    lag = selector.with_effect(base, "steering_lag")
    monkeypatch.setattr(forms, "_replacements", lambda *_: iter(()))
    monkeypatch.setattr(forms, "_best_replacement", lambda _extended, current, _models: replace(current, names=(law,)))
    monkeypatch.setattr(Selector, "backward_elimination", lambda _self, _base, current, _group: (current, {law: 100.0}))
    reformed = forms.select_variants(Selection(base, lag, {}, {"steering_lag": 500.0}, {}, 2), selector)
    assert reformed.chosen.names == (law,)
    assert reformed.rejected == again


def test_what_runs_away_is_as_good_as_nothing(selector, monkeypatch):
    def away(*_, **__):
        raise np.linalg.LinAlgError

    fresh = selector.for_batch(selector.batch)
    base = fresh.base()
    monkeypatch.setattr(Selector, "_preliminary_fit", away)
    lag = fresh.with_effect(base, "steering_lag")
    assert (lag.names, lag.deviance) == (("steering_lag",), base.deviance)
    assert not fresh.meets_criterion(base, lag)


def test_where_a_slow_servo_stood_can_be_decided_again(selector):
    right = selector.with_effect(selector.base(), "steering_lag")
    wrong_belief = under_other_initial_steering(selector)
    wrong = wrong_belief.with_effect(wrong_belief.base(), "steering_lag")
    assert prefers_other_initial_steering(wrong, wrong_belief)
    assert not prefers_other_initial_steering(right, selector)
    assert not prefers_other_initial_steering(wrong_belief.base(), wrong_belief)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_fit_does_not_depend_on_what_was_asked_for_before(selector, order):
    base, tried = selector.base(), default_candidate("steering_lag")
    starts = [replace(tried, starts=np.array([[start]])) for start in (0.05, 0.3)]
    fresh = selector.for_batch(selector.batch)
    found = {k: fresh.with_effect(fresh.base(), "steering_lag", starts[k]) for k in order}
    alone = [selector.for_batch(selector.batch).with_effect(base, "steering_lag", start) for start in starts]
    assert [found[k].deviance for k in (0, 1)] == [model.deviance for model in alone]
    assert alone[0].deviance != alone[1].deviance
    assert fresh.with_effect(fresh.base(), "steering_lag", starts[1]) is found[1]


def test_a_term_that_is_worth_nothing_alone_leaves_the_explanation_as_it_is(selector, monkeypatch):
    base, wide = selector.base(), with_extended_library(selector)
    elsewhere = np.array([0.1, 40.0, 40.0, 0.2])
    with_term = wide.score((SpeedInDisc.name,), np.r_[base.fit.parameters, elsewhere], None)
    chosen = Selection(base, with_term, {}, {}, {}, 1)
    term_selection = TermSelection(chosen, (SelectedTerm(SpeedInDisc, base, 0.0, 1.0),), base)
    monkeypatch.setattr(empirical, "add_term", lambda *_: term_selection)
    named = Selection(base, selector.with_effect(base, "lateral_slip"), {}, {"lateral_slip": 20.0}, {}, 1)
    assert empirical.add_term_and_reconsider(named, selector) == (named, term_selection, selector)


def test_a_step_to_where_the_model_cannot_be_evaluated_ends_the_iteration(selector, monkeypatch):
    base = selector.base()
    solver = LevenbergMarquardt(base.fit.predictor, np.empty((0, 2)))
    start = FitState(base.fit.parameters + 0.05, base.fit.random_effects, base.fit.variance_components)
    calls, linearise = [], Predictor.linearise

    def fails_the_third_time(self, *arguments):
        calls.append(arguments)
        linear = linearise(self, *arguments)
        return replace(linear, by_own=linear.by_own * np.nan) if len(calls) == 3 else linear

    monkeypatch.setattr(Predictor, "linearise", fails_the_third_time)
    iterated = solver.iterate(start, 8)
    assert (len(calls), iterated.convergence) == (3, Convergence.CONVERGED)
    assert np.isfinite(solver.evaluate(iterated.state).loss)
    calls[:] = [(), ()]
    with pytest.raises(np.linalg.LinAlgError, match="cannot be evaluated"):
        solver.iterate(start, 8)


def test_steps_that_do_not_gain_what_they_predict_end_the_iteration(selector, monkeypatch):
    base = selector.base()
    solver = LevenbergMarquardt(base.fit.predictor, np.empty((0, 2)))
    start = FitState(base.fit.parameters, base.fit.random_effects, base.fit.variance_components)
    start, _ = solver.at_fixed_point(start, solver.evaluate(start))
    steps = []

    def stays(_, point, terms):
        steps.append(terms)
        return Step(point, False, 10.0 * FIT.converged)

    monkeypatch.setattr(StepSolver, "step", stays)
    iterated = solver.iterate(start, 10)
    assert (len(steps), iterated.convergence) == (1, Convergence.SLOW)
