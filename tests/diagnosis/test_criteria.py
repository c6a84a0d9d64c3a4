"""Every criterion of a diagnosis is stated in its provenance, with a reason in its class."""

from __future__ import annotations

from dataclasses import fields

import pytest
from tiny_vehicle import Tiny

from agvbench.diagnosis import criteria, diagnose

CLASSES = (
    criteria.DataCriteria,
    criteria.MapCriteria,
    criteria.FitCriteria,
    criteria.SelectionCriteria,
    criteria.VariantCriteria,
    criteria.DiscrepancyCriteria,
    criteria.ResidualCriteria,
    criteria.DesignCriteria,
)


@pytest.mark.parametrize("kind", [*CLASSES, criteria.LoggedCriteria])
def test_every_criterion_has_a_reason(kind):
    assert kind.__doc__ is not None
    assert [field.name for field in fields(kind) if f"``{field.name}``" not in kind.__doc__] == []


@pytest.mark.slow
def test_a_diagnosis_states_the_criteria_that_it_used(tiny_campaign):
    stated = diagnose(tiny_campaign(Tiny())).to_json()["provenance"]["criteria"]
    assert sum(map(len, stated.values())) == sum(len(fields(kind)) for kind in CLASSES)
    assert stated["selection"]["min_gain"] == criteria.SELECTION.min_gain
