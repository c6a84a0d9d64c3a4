"""Variants of an effect that cross-validation refuses: a constant deceleration is no lag, but a variant of one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from tiny_selector import selector_of
from tiny_vehicle import Tiny, campaign_runs

from agvbench.campaign import Campaign
from agvbench.diagnosis.data.readings import read_runs
from agvbench.diagnosis.data.splits import split_runs
from agvbench.diagnosis.selection.refused_effects import with_refused_effects
from agvbench.diagnosis.selection.stepwise import Selector

SIMULATOR = Path(__file__).parents[2] / "benchmarks" / "independent" / "wheel_constraints.py"
DECELERATION_MPS2 = 1.78795


@pytest.fixture(scope="module")
def coasting(tmp_path_factory: pytest.TempPathFactory) -> Selector:
    """Return the selector of the training runs of a foreign vehicle that coasts with a constant deceleration."""
    folder = tmp_path_factory.mktemp("coasting") / "campaign"
    command = [sys.executable, SIMULATOR, "write", "--vehicle=513", "--causes=run_out", "--seed=1", folder]
    subprocess.run(command, check=True, capture_output=True)
    campaign = Campaign.open(folder)
    readings = read_runs(list(campaign), campaign.header.neutral)
    split = split_runs(readings.runs, readings.group, campaign.header.neutral, 0)
    return selector_of(readings.select(split.training).runs, campaign.header)


@pytest.mark.slow
def test_an_effect_with_the_wrong_equation_leads_to_the_right_one(coasting):
    selection = coasting.select()
    lag = coasting.with_effect(selection.chosen, "speed_lag")
    assert "speed_lag" not in selection.chosen.names
    assert lag.fit_gain_over(selection.chosen) > 100.0
    assert lag.deviance > selection.chosen.deviance

    found = with_refused_effects(selection, coasting)
    assert "speed_lag_friction" in found.chosen.names
    values = found.chosen.fit.effect_values()
    assert values["speed_lag_friction.coast_mps2"] == pytest.approx(DECELERATION_MPS2, rel=0.1)
    assert found.gains["speed_lag_friction"] > 1000.0


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", [Tiny(), Tiny(steering_lag_s=0.15)])
def test_a_selection_that_refuses_nothing_of_weight_stays(vehicle):
    selector = selector_of(campaign_runs(vehicle))
    selection = selector.select()
    assert with_refused_effects(selection, selector) is selection
