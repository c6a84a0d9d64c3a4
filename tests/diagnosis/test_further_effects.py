"""Effects that only training and validation runs together show, and the validation that rejects them."""

from __future__ import annotations

import pytest
from tiny_selector import selector_of
from tiny_vehicle import HEADER, Tiny, campaign_runs

from agvbench.diagnosis import runs_from_rest
from agvbench.diagnosis.data.readings import read_runs
from agvbench.diagnosis.data.splits import split_runs
from agvbench.diagnosis.runs_from_rest import RunsFromRest, SelectedFromRest
from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.diagnosis.selection.subsampling import refit_to_all
from agvbench.diagnosis.selection.variants import with_extended_library


def further(vehicle: Tiny, alternatives: dict[str, float]) -> Selection:
    """Return the selection of the steering lag alone, continued with all runs of a vehicle but the test runs."""
    readings = read_runs(campaign_runs(vehicle), HEADER.neutral)
    split = split_runs(readings.runs, readings.group, HEADER.neutral, 0)
    selector = selector_of(readings.select(split.training).runs)
    base = with_extended_library(selector).base()
    chosen = with_extended_library(selector).with_effect(base, "steering_lag")
    selection = Selection(base, chosen, {"steering_lag": alternatives}, {"steering_lag": 100.0}, {}, 0)
    selection, _ = refit_to_all(selection, None, selector, readings.select(~split.test))
    return RunsFromRest._with_further_effects(SelectedFromRest(selection, None, selector, split), readings).library


@pytest.mark.slow
def test_an_effect_that_the_selection_lacks_is_added_and_fitted_to_both_parts():
    vehicle = Tiny(steering_lag_s=0.15, cornering_loss=0.15)
    found = further(vehicle, {"actuation_delay": 1e9, "cornering_speed_loss": -1e9})
    assert {*found.chosen.names} == {*found.gains} == {"steering_lag", "cornering_speed_loss"}
    assert "cornering_speed_loss" not in found.alternatives["steering_lag"]
    assert found.chosen.fit.effect_values()["cornering_speed_loss.loss"] == pytest.approx(0.15, abs=0.01)
    every = read_runs(campaign_runs(vehicle), HEADER.neutral)
    test = split_runs(every.runs, every.group, HEADER.neutral, 0).test
    assert len(found.chosen.fit.predictor.readings) == (~test).sum()


@pytest.mark.slow
def test_an_effect_without_which_the_validation_runs_are_predicted_better_is_not_added(monkeypatch):
    compared = []

    def predicts(with_it, without, kept):
        compared.append((with_it.names, without.names, len(kept), len(with_it.fit.predictor.readings)))
        return False

    monkeypatch.setattr(runs_from_rest, "predicts", predicts)
    vehicle = Tiny(steering_lag_s=0.15, cornering_loss=0.15)
    assert further(vehicle, {}).chosen.names == ("steering_lag",)
    every = read_runs(campaign_runs(vehicle), HEADER.neutral)
    split = split_runs(every.runs, every.group, HEADER.neutral, 0)
    # Both are fitted to the training runs alone.
    names = ("steering_lag", "cornering_speed_loss"), ("steering_lag",)
    assert compared == [(*names, split.validation.sum(), split.training.sum())]


@pytest.mark.slow
def test_a_selection_that_lacks_nothing_stays():
    vehicle = Tiny(steering_lag_s=0.15)
    found = further(vehicle, {"actuation_delay": 3.0})
    assert found.chosen.names == ("steering_lag",)
    assert found.alternatives == {"steering_lag": {"actuation_delay": 3.0}}
