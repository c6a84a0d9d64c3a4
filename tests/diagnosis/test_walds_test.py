"""Which effects the runs determine: limits are tested by their inverse, and no effect is what its bounds exclude."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_selector import selector_of
from tiny_vehicle import Tiny

from agvbench.diagnosis.estimation.cross_validation import differs_from_null
from agvbench.diagnosis.selection.variants import with_extended_library


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tiny", "limit_mps2"),
    [(Tiny(noise_m=3e-3, noise_rad=0.01), None), (Tiny(ramp_forward_mps2=0.6, ramp_backward_mps2=0.6), 0.6)],
)
def test_a_limit_that_nothing_reaches_does_not_differ_from_none(tiny_campaign, tiny, limit_mps2):
    extended = with_extended_library(selector_of(tiny_campaign(tiny)))
    maps = extended.base().fit.parameters
    fitted = extended.score(("speed_lag_ramp",), np.r_[maps, 2.0, 2.0], None).fit
    assert differs_from_null(fitted, "speed_lag_ramp", extended.batch.readings.group) == (limit_mps2 is not None)
    if limit_mps2 is not None:
        assert fitted.effect_values()["speed_lag_ramp.acceleration_mps2"] == pytest.approx(limit_mps2, rel=0.05)


def test_an_effect_that_its_bounds_exclude_is_not_selected(tiny_campaign):
    """The vehicle turns more the faster it is, by more than the slip of any tyre could be negative."""
    selector = selector_of(tiny_campaign(Tiny(slip=-1.0)))
    base = selector.base()
    model = selector.with_effect(base, "lateral_slip")
    assert selector.improves(base, model)
    assert model.is_at_bound("lateral_slip")
    assert not selector.meets_criterion(base, model)


@pytest.mark.slow
def test_an_effect_within_its_bounds_is_selected(tiny_campaign):
    selector = selector_of(tiny_campaign(Tiny(slip=0.8)))
    model = selector.with_effect(selector.base(), "lateral_slip")
    assert not model.is_at_bound("lateral_slip")
    assert selector.meets_criterion(selector.base(), model)
