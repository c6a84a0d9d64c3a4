"""The reference names everything that can be hidden, and what it depends on."""

from __future__ import annotations

import re
from pathlib import Path

from agvbench.simulator.hidden.catalogue import CATALOGUE
from agvbench.simulator.hidden.reference_drives import reference_drives
from agvbench.simulator.hidden.sampling import vehicle_of

TEXT = (Path(__file__).parents[3] / "docs" / "reference" / "challenge-plants.md").read_text(encoding="utf-8")


def test_every_effect_is_named():
    assert set(re.findall(r"`([a-z_]+)`", TEXT)) >= set(CATALOGUE)


def test_covariates_of_what_lies_outside_are_those_of_the_recipes():
    rows = dict(re.findall(r"^\| `([a-z_]+)` \| .* \| (`.*`) \|$", TEXT, re.MULTILINE))
    for name, recipe in CATALOGUE.items():
        if recipe.kind == "outside":
            assert tuple(re.findall(r"`([a-z_]+)`", rows[name])) == recipe.covariates


def test_effects_that_nodal_maps_absorb_are_listed():
    listed = re.search(r"((?:`[a-z_]+`(?:,| and)?\s+)+)are\s+absorbed\s+by\s+nodal\s+maps", TEXT)
    assert listed is not None
    assert set(re.findall(r"`([a-z_]+)`", listed[1])) == {r.name for r in CATALOGUE.values() if r.absorbed}


def test_number_of_reference_drives():
    assert f"{len(reference_drives(vehicle_of(1).constants))} reference drives" in TEXT
