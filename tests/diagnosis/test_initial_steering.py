"""Where the axles were before the first command is decided by the runs, and again beside other causes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tiny_selector import selector_of
from tiny_vehicle import Tiny

from agvbench.diagnosis.selection.initial_steering import (
    reconsider_initial_steering,
    select_with_initial_steering,
    under_other_initial_steering,
)
from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.diagnosis.selection.validation import predicts
from agvbench.diagnosis.selection.variants import prefers_other_initial_steering, with_extended_library


def test_another_cause_decides_on_the_initial_steering_again(tiny_campaign):
    """Beside the slip that was missing at first, a backlash tells where the axles were."""
    right = selector_of(tiny_campaign(Tiny(slip=0.3, play_rad=0.06)))
    assert not right.batch.readings.preset
    wrong = under_other_initial_steering(right)
    base = wrong.base()
    slipping = Selection(base, wrong.with_effect(base, "lateral_slip"), {}, {}, {}, wrong.models_fitted)
    selection, selector = reconsider_initial_steering(slipping, wrong)
    assert not selector.batch.readings.preset
    assert {"lateral_slip", "steering_backlash"} <= {*selection.chosen.names}


@pytest.mark.parametrize("begins_right", [True, False])
def test_the_initial_steering_is_changed_while_effects_are_selected(tiny_campaign, begins_right):
    right = selector_of(tiny_campaign(Tiny(slip=0.3, play_rad=0.06)))
    said: list[str] = []
    right.on_progress = said.append
    selection, selector = select_with_initial_steering(right if begins_right else under_other_initial_steering(right))
    assert not selector.batch.readings.preset
    assert {"lateral_slip", "steering_backlash"} <= {*selection.chosen.names}
    steps = [line.partition(": gains")[0] for line in said if ": gains" in line]
    assert len({*steps}) == len(steps) >= 2  # no step was repeated


def test_without_a_gain_the_initial_steering_stays(tiny_campaign):
    selector = selector_of(tiny_campaign(Tiny(slip=0.3)))
    base = selector.base()
    slipping = Selection(base, selector.with_effect(base, "lateral_slip"), {}, {}, {}, selector.models_fitted)
    assert reconsider_initial_steering(slipping, selector) == (slipping, selector)


def test_a_term_of_earlier_steering_decides_on_the_initial_steering(tiny_campaign):
    """A supply that sags when servos move shows whether they moved at the first command."""
    right = selector_of(tiny_campaign(Tiny(sag_per_rad=0.8)))
    assert not right.batch.readings.preset
    for selector, prefers_other in ((right, False), (under_other_initial_steering(right), True)):
        extended = with_extended_library(selector)
        base = extended.base()
        assert not prefers_other_initial_steering(base, selector)
        sagging = extended.with_effect(base, "speed_after_steering")
        assert prefers_other_initial_steering(sagging, selector) == prefers_other


def test_validation_runs_have_the_initial_steering_of_the_model(tiny_campaign):
    """The axles of a slow steering stood at their first command: runs with that command alone show no lag."""
    selector = selector_of(tiny_campaign(Tiny(steering_lag_s=0.3, is_preset=True)))
    assert selector.batch.readings.preset
    base = selector.base()
    lag = selector.with_effect(base, "steering_lag")
    as_read = replace(selector.batch.readings, preset=False)
    held = as_read.select(np.array([run.experiment.startswith("steering_") for run in as_read.runs]))
    assert predicts(lag, base, held)
