"""A backlash has its name only where the runs contradict another hysteresis of the steering."""

from __future__ import annotations

import pytest
from tiny_selector import selector_of
from tiny_vehicle import Tiny, campaign_runs

from agvbench.diagnosis import Verdict, diagnose
from agvbench.diagnosis.criteria import SELECTION
from agvbench.diagnosis.discrepancy.other_forms import models_of_other_forms, with_other_forms
from agvbench.diagnosis.selection.stepwise import Selection, Selector
from agvbench.diagnosis.selection.variants import with_extended_library

pytestmark = pytest.mark.slow

PLAY, FRICTION = Tiny(play_rad=0.04), Tiny(friction_rad=0.02, friction_share=0.25)
NARROW = Tiny(play_rad=0.015)


def with_backlash(tiny: Tiny) -> tuple[Selection, Selector]:
    """Return the model with a backlash, whatever is true of the vehicle."""
    selector = selector_of(campaign_runs(tiny))
    extended = with_extended_library(selector)
    base = extended.base()
    chosen = extended.with_effect(base, "steering_backlash")
    gains = {"steering_backlash": base.deviance - chosen.deviance}
    return Selection(base, chosen, {"steering_backlash": {}}, gains, {}, 0), selector


def test_runs_with_backlash_contradict_the_other_form():
    selection, selector = with_backlash(PLAY)
    ((_, _, model),) = models_of_other_forms(with_extended_library(selector), selection)
    assert model.deviance - selection.chosen.deviance > SELECTION.alternative_margin
    assert with_other_forms(selection, selector).alternatives == {"steering_backlash": {}}


def test_runs_with_friction_are_predicted_better_by_the_other_form():
    selection, selector = with_backlash(FRICTION)
    ((name, term, model),) = models_of_other_forms(with_extended_library(selector), selection)
    assert (name, term.name) == ("steering_backlash", "steering_by_travel")
    assert model.gain_over(selection.chosen) > SELECTION.min_gain


def test_a_backlash_that_is_narrow_against_the_steps_may_have_either_form():
    selection, selector = with_backlash(NARROW)
    assert "steering_by_travel" in with_other_forms(selection, selector).alternatives["steering_backlash"]


def test_an_effect_without_another_form_is_tried_beside_none():
    selector = selector_of(campaign_runs(Tiny(steering_lag_s=0.1)))
    base = selector.base()
    chosen = selector.with_effect(base, "steering_lag")
    selection = Selection(base, chosen, {"steering_lag": {}}, {"steering_lag": 1.0}, {}, 0)
    assert with_other_forms(selection, selector) is selection


def test_the_verdict_on_friction_is_unknown_without_the_name_of_a_backlash(tiny_campaign):
    found = diagnose(tiny_campaign(FRICTION))
    assert found.verdict is Verdict.UNKNOWN
    assert "steering_backlash" not in {effect.name for effect in found.effects}
    assert found.depends_on[0].covariate == "history"


def test_the_verdict_on_backlash_names_it(tiny_campaign):
    found = diagnose(tiny_campaign(PLAY))
    assert found.verdict is Verdict.NAMED
    assert [effect.name for effect in found.effects] == ["steering_backlash"]
