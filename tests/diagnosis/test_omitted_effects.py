"""What effects that a model omits add to the uncertainty of its parameters."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_selector import selector_of
from tiny_vehicle import Tiny

from agvbench.diagnosis.estimation.score_test import OneStepEstimate
from agvbench.diagnosis.findings.omitted_effects import OmittedEffect, contributed_stderr, omitted_effects


def omitted(*directions: tuple[float, float, float]) -> OmittedEffect:
    """Return an effect of one parameter, with null 0, by (estimate, standard error, influence) in each direction."""
    one = (OneStepEstimate(np.array([e]), np.array([s]), np.array([[i]])) for e, s, i in directions)
    return OmittedEffect(np.zeros(1), np.full(1, 10.0), tuple(one))


def test_an_effect_that_may_be_null_adds_nothing():
    assert omitted((1.9, 1.0, 5.0)).contribution() == pytest.approx(0.0)


def test_an_effect_counts_by_its_least_size_and_its_influence():
    assert omitted((3.96, 1.0, 0.5)).contribution() == pytest.approx(1.0)
    assert omitted((-3.96, 1.0, 0.5)).contribution() == pytest.approx(1.0)


def test_the_direction_that_contributes_most_counts():
    assert omitted((0.0, 1.0, 0.5), (3.96, 1.0, 0.5)).contribution() == pytest.approx(1.0)


def test_an_effect_counts_by_no_more_than_its_typical_size():
    assert omitted((1000.0, 1.0, 0.5)).contribution() == pytest.approx(25.0)


def test_contributions_of_several_effects_add_up_as_variances():
    assert contributed_stderr([omitted((3.96, 1.0, 1.5)), omitted((3.96, 1.0, 2.0))], 1) == pytest.approx(5.0)
    assert contributed_stderr([], 2).tolist() == [0.0, 0.0]


@pytest.mark.slow
def test_the_influence_is_by_how_much_the_others_move_once_it_is_added(tiny_campaign):
    selector = selector_of(tiny_campaign(Tiny(steering_lag_s=0.1, delay_s=0.04)))
    without = selector.with_effect(selector.base(), "steering_lag")
    found = omitted_effects(without.fit)
    assert "steering_lag" not in found
    delay = found["actuation_delay"].estimates[0]
    after = selector.with_effect(without, "actuation_delay").fit.effect_values()
    before = without.fit.effect_values()["steering_lag.time_constant_s"]
    moved = after["steering_lag.time_constant_s"] - before
    assert abs(moved) > 0.01
    assert delay.influence[-1, 0] * after["actuation_delay.delay_s"] == pytest.approx(moved, rel=0.5)
    uncertainty = contributed_stderr(found.values(), len(without.fit.parameters))[-1]
    assert uncertainty > 0.3 * abs(moved)
