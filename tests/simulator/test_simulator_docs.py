"""The plant of the how-to is a plant, and the tables of the reference name what there is."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

from agvbench.simulator import Camera, check_plant
from agvbench.simulator.plant_contract import CLAUSES
from agvbench.simulator.plant_parameters import DIFFERENTIAL, TWO_AXLES
from agvbench.simulator.plants import PLANTS

DOCS = Path(__file__).parents[2] / "docs"


def test_the_plant_of_the_how_to_keeps_the_contract(tmp_path, monkeypatch):
    source = re.search(r"```python\n(.*?)```", (DOCS / "how-to" / "bring-your-own-plant.md").read_text(), re.DOTALL)
    assert source is not None
    (tmp_path / "my_plant.py").write_text(source[1])
    monkeypatch.chdir(tmp_path)
    check_plant("my_plant.py:make_plant")


def test_the_reference_names_every_clause_plant_and_option():
    text = (DOCS / "reference" / "simulator.md").read_text()
    named = set(re.findall(r"`([a-z][a-z0-9_]*)`", text)) | set(re.findall(r"agvbench\.simulator:([a-z_]+)", text))
    options = {item.name for item in fields(Camera)} - {"markers"}
    assert named >= set(CLAUSES) | set(PLANTS) | options | set(TWO_AXLES) | set(DIFFERENTIAL)
