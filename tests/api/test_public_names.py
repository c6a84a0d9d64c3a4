"""``import agvbench``: cheap, complete, and the same for mypy and at run time."""

from __future__ import annotations

import ast
import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

import agvbench

EXPORTED = (
    *("Campaign", "Run", "Pose", "VehicleModel", "Trajectory", "plan", "simulate", "calibrate", "identify", "diagnose"),
    *("Diagnosis", "Verdict", "compare", "pose_errors", "write_report", "AgvbenchError", "plot"),
    *("PoseNoise", "SimulatedRun", "Simulation", "Comparison", "valid"),
    *("History", "history", "sweep"),
)


def test_what_notebooks_need_is_exported_and_listed():
    assert sorted(agvbench.__all__) == sorted(EXPORTED)
    assert set(EXPORTED) <= set(dir(agvbench))
    assert not [name for name in EXPORTED if getattr(agvbench, name) is None]


def test_the_page_of_the_api_has_one_line_for_every_name():
    page = (Path(__file__).parents[2] / "docs" / "reference" / "api.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| `") and "agvbench" not in line.split("|")[1]]
    assert sorted(name for row in rows for name in re.findall(r"`(\w+)`", row.split("|")[1])) == sorted(EXPORTED)


def test_importing_agvbench_imports_no_heavy_library():
    heavy = "{'numpy', 'pandas', 'scipy', 'numba', 'matplotlib', 'pyarrow', 'zenoh', 'rich', 'msgspec'}"
    code = f"import sys, agvbench; print(sorted({heavy} & set(sys.modules)))"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"


def test_mypy_and_python_see_the_same_names_from_the_same_packages():
    source = Path(agvbench.__file__).read_text(encoding="utf-8")
    typed = {
        alias.name: str(node.module).split(".")[1:2]
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("agvbench")
        for alias in node.names
    }
    assert typed == {name: home.split(".")[:1] for name, home in agvbench._HOMES.items()} | {"plot": []}


@pytest.mark.parametrize("name", [name for name in EXPORTED if name != "plot"])
def test_no_submodule_hides_an_exported_name(name):
    assert importlib.util.find_spec(f"agvbench.{name}") is None


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'agvbench' has no attribute 'campain'"):
        _ = agvbench.campain


def test_everything_can_be_imported_by_a_star():
    names: dict[str, object] = {}
    exec("from agvbench import *", names)  # noqa: S102 - it is what a user may write
    assert names["Verdict"] is agvbench.Verdict
    assert names["Verdict"].NAMED == "NAMED"
