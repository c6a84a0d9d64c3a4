"""Authors of adapters, plants and effects import from one package each."""

from __future__ import annotations

import inspect
import re
import typing
from pathlib import Path

import pytest

from agvbench import adapters, effects, simulator

DOCS = Path(__file__).parents[2] / "docs"
IMPORT = re.compile(r"^\s*(?:>>> )?from (agvbench[\w.]*) import (.+)$", re.MULTILINE)
# What the hooks of an effect see has names of its own, such as X and PLAY. An effect is a file of the package
# agvbench.effects, which is still being imported when the effect is, so that it imports its base class from its module.
PACKAGES = re.compile(r"agvbench(\.\w+)?|agvbench\.effects\.(state|base)|agvbench\.simulator\.hidden")


def classes_in(annotation: object) -> set[type]:
    """Return the classes of agvbench in an annotation."""
    found = {annotation} if isinstance(annotation, type) else set()
    found |= {one for argument in typing.get_args(annotation) for one in classes_in(argument)}
    return {one for one in found if one.__module__.startswith("agvbench.")}


@pytest.mark.parametrize("contract", ["AgvAdapter", "MocapAdapter", "AgvReports", "MocapReports"])
def test_what_an_adapter_gets_and_returns_is_exported_beside_its_base(contract):
    base = getattr(adapters, contract)
    methods = [member for name, member in inspect.getmembers(base, callable) if not name.startswith("_")]
    annotations = [hint for method in methods for hint in typing.get_type_hints(method).values()]
    needed = {one.__name__ for annotation in annotations for one in classes_in(annotation)}
    assert needed
    assert needed <= set(adapters.__all__)


def test_a_plant_is_written_and_checked_with_one_package():
    assert {"Plant", "PlantFactory", "check_plant", "load_plant"} <= set(simulator.__all__)


def test_effects_are_exported_beside_their_base():
    exported = {name for name in effects.__all__ if isinstance(getattr(effects, name), type)}
    kinds = {kind.__name__ for kind in effects.effect_kinds().values()}
    assert {"SteeringLag", "BatteryDroop"} < exported - {"Effect", "Parameter", "Stage"} <= kinds


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=lambda page: page.stem)
def test_pages_import_from_packages_what_these_export(page):
    found = IMPORT.findall(page.read_text(encoding="utf-8"))
    assert [module for module, _ in found if not PACKAGES.fullmatch(module)] == []
