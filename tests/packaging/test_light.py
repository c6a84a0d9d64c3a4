"""The light installation judges campaigns without bus, viewer, compiler and adapters, and says so where it cannot."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[2]
LIGHT = ROOT / "packaging" / "light"
LEFT_OUT = {"dpkt", "eclipse-zenoh", "numba", "pyserial", "rerun-sdk"}
MODULES = ("dpkt", "zenoh", "eclipse_zenoh", "numba", "llvmlite", "serial", "pyserial", "rerun")


def _dependencies(path):
    return tomllib.loads(path.read_text(encoding="utf-8"))["project"]["dependencies"]


@pytest.fixture(scope="module")
def light(build_wheel, installed):
    return installed(build_wheel(LIGHT), without=MODULES)


@pytest.fixture
def campaign(tmp_path):
    return Path(shutil.copytree(ROOT / "tests/campaign/data/schema_4/parquet", tmp_path / "campaign"))


def test_it_has_the_same_dependencies_but_those_that_drive():
    whole, light = _dependencies(ROOT / "pyproject.toml"), _dependencies(LIGHT / "pyproject.toml")
    assert set(light) < set(whole)
    assert {Requirement(one).name for one in set(whole) - set(light)} == LEFT_OUT


@pytest.mark.parametrize("command", ["bench", "diagnose .", "watch"])
def test_a_command_that_needs_more_says_what(light, command, tmp_path):
    done = light(*command.split(), cwd=tmp_path)
    assert done.returncode == 2
    assert "needs more than the light installation: missing: " in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
def test_it_reports_exports_and_keeps_a_history(light, campaign, tmp_path):
    report = light("report", str(campaign), cwd=tmp_path)
    assert report.returncode == 0, report.stderr
    assert "campaign.rrd is left out: rerun-sdk is not installed" in report.stdout
    assert (campaign / "report" / "report.html").exists()
    assert light("export", str(campaign), "--out", "tum", cwd=tmp_path).returncode == 0
    assert light("history", str(tmp_path), cwd=tmp_path).returncode == 0


@pytest.mark.slow
def test_it_reproduces_the_thesis(light, tmp_path):
    done = light("thesis", "--out", "tables", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert list((tmp_path / "tables").glob("*.csv"))
