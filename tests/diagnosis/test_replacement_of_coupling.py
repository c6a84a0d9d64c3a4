"""Wrong axle distances resemble a coupling of the axles, also where a delay moves when the coupling is removed.

The campaign is that of a simulator by another author. Its axle distances are wrong by a millimetre, and nothing couples
its axles.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from agvbench.campaign import Campaign
from agvbench.diagnosis import diagnose

pytestmark = pytest.mark.slow

SIMULATORS = Path(__file__).parents[2] / "benchmarks" / "independent"


def test_displaced_markers_are_named_or_an_alternative_of_the_coupling(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(SIMULATORS)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    import state_space

    state_space.write_campaign(tmp_path / "campaign", 616, ["heading_misalignment"], seed=1)
    effects = diagnose(Campaign.open(tmp_path / "campaign")).effects
    assert any("marker_offset" in {effect.name, *effect.confounded_with} for effect in effects)
