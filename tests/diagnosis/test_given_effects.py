"""Effects that a vehicle is known to have are where a fit begins, whatever its file leaves out."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from tiny_vehicle import HEADER, Tiny, campaign_runs

from agvbench.diagnosis.context import DiagnosisContext
from agvbench.diagnosis.runs_from_rest import RunsFromRest
from agvbench.diagnosis.selection.candidates import given_effects
from agvbench.effects import effect_kinds
from agvbench.effects.variants import effect_variants
from agvbench.model import nominal_model

KINDS = {**effect_kinds(), **effect_variants()}
WITH_LIMITS = [name for name, kind in KINDS.items() if any(np.isinf(p.null) for p in kind.parameters())]


def vehicle(name, **values):
    nominal = nominal_model("tiny", HEADER.geometry, HEADER.channels)
    return dataclasses.replace(nominal, effects=(KINDS[name](**values),))


@pytest.mark.parametrize("name", WITH_LIMITS)
def test_a_limit_that_is_left_out_is_finite_in_a_fit(name):
    for p in KINDS[name].parameters():
        known = SimpleNamespace(effects=(KINDS[name](**{p.name: p.scale}),), priors=())
        _, values = given_effects(known, [name])
        assert np.isfinite(values).all()


def test_a_known_ramp_without_a_limit_when_braking_can_be_fitted():
    context = DiagnosisContext(HEADER, HEADER.geometry, vehicle("speed_lag_ramp", acceleration_mps2=2.0), 0)
    method = RunsFromRest(context, lambda line: None)
    base = method.selector(method.read(campaign_runs(Tiny(speed_scatter=0.001)))).base()
    assert np.isfinite(base.fit.parameters).all()
    assert np.isfinite(base.deviance)
