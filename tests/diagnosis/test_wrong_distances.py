"""Axle distances that are wrong by a millimetre are named beside other causes, or are an alternative of a name.

The campaigns are those of a simulator by another author, whose axle distances are always wrong. Nothing couples its
axles, and nothing is outside the library.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from agvbench.campaign import Campaign
from agvbench.diagnosis import Verdict, diagnose

pytestmark = pytest.mark.slow

SIMULATORS = Path(__file__).parents[2] / "benchmarks" / "independent"


@pytest.mark.parametrize(
    ("vehicle", "cause"),
    [
        pytest.param(616, "heading_misalignment", id="the delays move when a coupling is removed"),
        pytest.param(617, "actuation_delay", id="a discrepancy term predicts better and fits worse"),
    ],
)
def test_wrong_distances_are_markers_elsewhere(tmp_path, monkeypatch, vehicle, cause):
    monkeypatch.syspath_prepend(SIMULATORS)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    import state_space

    state_space.write_campaign(tmp_path / "campaign", vehicle, [cause], seed=1)
    found = diagnose(Campaign.open(tmp_path / "campaign"))
    assert found.verdict is not Verdict.UNKNOWN
    assert cause in {effect.name for effect in found.effects}
    assert any("marker_offset" in {effect.name, *effect.confounded_with} for effect in found.effects)
