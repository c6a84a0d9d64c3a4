"""The reference names everything that can be hidden, and what it depends on."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from agvbench.simulator.hidden.catalogue import CATALOGUE, catalogue
from agvbench.simulator.hidden.reference_drives import reference_drives
from agvbench.simulator.hidden.sampling import vehicle_of

PAGE = (Path(__file__).parents[3] / "docs" / "reference" / "challenge-plants.md").read_text(encoding="utf-8")
_, _, DIFFERENTIAL = PAGE.partition("## Differential vehicles\n")
DIFFERENTIAL = DIFFERENTIAL.partition("## Blind trials\n")[0]
TEXT = PAGE.replace(DIFFERENTIAL, "")
SECTIONS = {"two_axle": TEXT, "differential": DIFFERENTIAL}


@pytest.mark.parametrize("kinematics", SECTIONS)
def test_every_effect_is_named(kinematics):
    assert set(re.findall(r"`([a-z_]+)`", SECTIONS[kinematics])) >= set(catalogue(kinematics))


def test_covariates_of_what_lies_outside_are_those_of_the_recipes():
    rows = dict(re.findall(r"^\| `([a-z_]+)` \| .* \| (`.*`) \|$", PAGE, re.MULTILINE))
    for name, recipe in (CATALOGUE | catalogue("differential")).items():
        if recipe.kind == "outside":
            assert tuple(re.findall(r"`([a-z_]+)`", rows[name])) == recipe.covariates


def test_effects_that_nodal_maps_absorb_are_listed():
    listed = re.search(r"((?:`[a-z_]+`(?:,| and)?\s+)+)are\s+absorbed\s+by\s+nodal\s+maps", TEXT)
    assert listed is not None
    assert set(re.findall(r"`([a-z_]+)`", listed[1])) == {r.name for r in CATALOGUE.values() if r.absorbed}


def test_what_maps_of_differential_vehicles_absorb_is_listed():
    listed = re.search(r"(.*) are marked `absorbed`", DIFFERENTIAL)
    assert listed is not None
    absorbed = {recipe.name for recipe in catalogue("differential").values() if recipe.absorbed}
    assert set(re.findall(r"`([a-z_]+)`", listed[1])) == absorbed


@pytest.mark.parametrize("kinematics", SECTIONS)
def test_number_of_reference_drives(kinematics):
    assert f"{len(reference_drives(vehicle_of(1, kinematics)))} reference drives" in SECTIONS[kinematics]
