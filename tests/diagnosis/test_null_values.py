"""What the gain of an effect is predicted from, where maps absorb most of it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tiny_selector import selector_of
from tiny_vehicle import HEADER, Tiny

from agvbench.diagnosis.model.repeats import Repeats
from agvbench.diagnosis.selection.candidates import candidate, candidates, default_candidate
from agvbench.diagnosis.terms import TERMS
from agvbench.effects import effect_kinds
from agvbench.effects.variants import effect_variants


@pytest.mark.parametrize("name", sorted(candidates(HEADER.geometry)))
def test_the_first_start_is_near_the_null_value(name):
    kinds, tried = effect_kinds()[name].parameters(), default_candidate(name)
    for p, value, scale in zip(kinds, tried.starts[0], tried.scale, strict=True):
        if not (p.is_direction or math.isinf(p.null)):
            assert abs(value - p.null) == pytest.approx(1e-3 * scale, rel=1e-6)
    for p, most in zip(kinds, np.max(np.abs(tried.starts), axis=0), strict=True):
        assert p.is_direction or math.isinf(p.null) or most == pytest.approx(p.scale)


@pytest.mark.parametrize("name", sorted(effect_variants()))
def test_variants_start_at_shares_of_their_scale(name):
    starts, kinds = default_candidate(name).starts, effect_variants()[name].parameters()
    amplitude = next((k for k, p in enumerate(kinds) if not (p.is_direction or math.isinf(p.null))), None)
    if amplitude is not None:
        assert np.min(np.abs(starts[:, amplitude])) > 1e-2 * kinds[amplitude].scale or kinds[amplitude].low > 0.0


@pytest.mark.parametrize("kind", [*effect_kinds().values(), *effect_variants().values(), *TERMS], ids=lambda k: k.name)
def test_no_fit_starts_twice_at_the_same_values(kind):
    starts = candidate(kind).starts
    assert len(starts) == len(np.unique(starts, axis=0))


def test_a_quadratic_prediction_of_a_small_removal_is_close(tiny_campaign):
    selector = selector_of(tiny_campaign(Tiny(steering_lag_s=0.012)))
    base = selector.base()
    model = selector.with_effect(base, "steering_lag")
    lost = base.fit.total_loss - model.fit.total_loss
    assert lost > 20.0
    # The variance components grow in a fit without the effect.
    assert lost < model.fit.predicted_loss_without("steering_lag") < 3.0 * lost


def test_what_is_predicted_to_gain_too_little_is_not_fitted_in_the_place_of_an_effect(tiny_campaign):
    selector = selector_of(tiny_campaign(Tiny(steering_lag_s=0.15)))
    base = selector.base()
    chosen = selector.with_effect(base, "steering_lag")
    others = [name for name in selector.candidates if name != "steering_lag"]
    likely = selector.likely(base, chosen, others)
    least = 0.1 * (base.fit.total_loss - chosen.fit.total_loss)
    assert set(likely) == {name for name in others if selector.predicted_gain(base, name) >= least}
    assert 0 < len(likely) < len(others)


def test_repeats_that_a_droop_makes_differ_do_not_hide_it(tiny_campaign):
    shared, alone = (selector_of(tiny_campaign(Tiny(droop_per_hour=0.1))) for _ in range(2))
    alone.batch.repeats = Repeats(np.arange(len(alone.batch.readings)))
    gains = [one.predicted_gain(one.base(), "battery_droop") for one in (shared, alone)]
    assert gains[1] > 20.0
    assert gains[0] == pytest.approx(gains[1], rel=0.3)
