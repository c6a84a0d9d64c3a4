"""The runs set aside have the last word."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tiny_vehicle import FRONT_M, HEADER, NEUTRAL, REAR_M, Tiny

from agvbench.calibration import measure_run
from agvbench.diagnosis.batch import Batch
from agvbench.diagnosis.candidates import candidates
from agvbench.diagnosis.explained import Explained
from agvbench.diagnosis.grouping import held_out_runs
from agvbench.diagnosis.levels import ROLES, free_maps, start_values
from agvbench.diagnosis.reading import read_runs
from agvbench.diagnosis.selection import Selection, Selector
from agvbench.diagnosis.terms.speed import SpeedInDisc
from agvbench.diagnosis.veto import withdrawn
from agvbench.vehicle.geometry import Geometry


@pytest.fixture(scope="module")
def found(tiny_campaign):
    """Return a selection of a steering lag that is there, and the runs set aside."""
    runs = list(tiny_campaign(Tiny(steering_lag_s=0.15)))
    readings, geometry = read_runs(runs, HEADER.neutral), Geometry(FRONT_M, REAR_M)
    held = held_out_runs(readings.runs, readings.group, 0)
    maps = free_maps(readings.runs, NEUTRAL)
    believed = {role: np.zeros(len(maps.nodes[role])) for role in ROLES}
    start = start_values(maps, [measure_run(run, geometry, neutral=NEUTRAL) for run in runs], believed)
    selector = Selector(Batch(readings.select(~held), maps, geometry), candidates(), start, 0, lambda _: None)
    base = selector.base()
    lag = selector.grown(base, "steering_lag")
    return Selection(base, lag, {}, {"steering_lag": 500.0}, {}, 2), readings.select(held)


@pytest.fixture
def spoilt(found):
    """Return the selection with a lag that is far off."""
    selection, _ = found
    wrong = selection.chosen.fit.parameters.copy()
    wrong[-1] = 0.9
    return replace(selection, chosen=replace(selection.chosen, fit=replace(selection.chosen.fit, parameters=wrong)))


def test_of_a_term_it_is_the_model_with_the_term_that_is_asked(found, spoilt):
    good, kept = found
    wrong = Explained(spoilt, SpeedInDisc, good.base, 100.0, 1e-4)
    left, term = withdrawn(good, wrong, kept, lambda _: None)
    assert term is None
    assert left.chosen is good.base
    right = Explained(good, SpeedInDisc, good.base, 100.0, 1e-4)
    assert withdrawn(spoilt, right, kept, lambda _: None) == (spoilt, right)


def test_a_cause_that_helps_stays(found):
    selection, kept = found
    said: list[str] = []
    assert withdrawn(selection, None, kept, said.append) == (selection, None)
    assert not said


def test_a_cause_that_makes_it_worse_is_withdrawn(found, spoilt):
    _, kept = found
    said: list[str] = []
    left, term = withdrawn(spoilt, None, kept, said.append)
    assert term is None
    assert left.chosen is spoilt.base
    assert left.gains == left.rivals == {}
    assert left.rejected == {"steering_lag": 500.0}
    assert said == ["steering_lag: withdrawn, for the runs set aside are predicted better without"]
