"""A model that lacks a cause is not determined by the few runs on which this cause acts."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_selector import selector_of
from tiny_vehicle import Tiny, front_of

from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.diagnosis.selection.subsampling import refit_with_heavy_tails


def selected(runs):
    selector = selector_of(runs)
    base = selector.base()
    return Selection(base, base, {}, {}, {}, selector.models_fitted), selector


def angle_error_rad(model):
    """Return the root mean square error of the front axle's angles at the nodes within the range of the servo."""
    maps = model.fit.predictor.maps
    nodes = maps.nodes["front"]
    inside = np.abs(nodes - 1500.0) < 400.0
    fitted = model.fit.parameters[maps.slices()["front"]]
    return float(np.sqrt(np.mean((fitted - [front_of(c) for c in nodes])[inside] ** 2)))


@pytest.fixture(scope="module")
def disturbed(tiny_campaign):
    """Return a selection without effects: in two groups of repeats with steps, the steering turns further."""
    pairs = zip(tiny_campaign(Tiny()), tiny_campaign(Tiny(steering_factor=1.5)), strict=True)
    return selected([b if b.experiment == "step" and 1350.0 in b.commands.drive else a for a, b in pairs])


def test_a_few_runs_that_the_model_does_not_describe_hardly_move_the_maps(disturbed):
    selection, selector = disturbed
    refitted, term = refit_with_heavy_tails(selection, None, selector)
    assert term is None
    assert angle_error_rad(refitted.chosen) < 0.25 * angle_error_rad(selection.chosen)
    assert refitted.base is selection.base


def test_a_model_that_fits_is_kept(tiny_campaign):
    selection, selector = selected(tiny_campaign(Tiny()))
    assert refit_with_heavy_tails(selection, None, selector) == (selection, None)
