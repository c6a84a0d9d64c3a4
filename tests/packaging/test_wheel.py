"""The built wheel, alone in an empty folder, lays out a lab and drives in it."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from agvbench.adapters.simavr.firmware_files import missing_packages

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def wheel(build_wheel):
    """The wheel that people install."""
    return build_wheel(ROOT)


@pytest.fixture(scope="module")
def agvbench(wheel, installed):
    """The command of an environment that has the wheel and this environment's dependencies, not this checkout."""
    return installed(wheel)


def test_the_wheel_carries_what_people_edit_and_no_more(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert {f"agvbench/_lab/trajectories/{file.name}" for file in (ROOT / "trajectories").glob("*.toml")} <= set(names)
    assert "agvbench/_lab/benchmarks/bench_trajectories.py" in names
    assert "agvbench/py.typed" in names
    assert {f"agvbench/_lab/firmware/{name}" for name in ("Makefile", "src/main.c", "simavr_host/simavr_host.c")} <= {
        *names
    }
    assert not [name for name in names if name.endswith((".elf", ".o")) or "/firmware/build" in name]
    assert not [name for name in names if name.startswith("tests/") or "__pycache__" in name]


@pytest.mark.skipif(bool(missing_packages()), reason=f"not installed: {' '.join(missing_packages())}")
def test_what_is_installed_can_build_the_firmware(agvbench, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    made = agvbench("firmware", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    [built] = (tmp_path / "cache" / "agvbench").iterdir()
    assert {"agv1.elf", "agv2.elf", "simavr_host"} <= {path.name for path in built.iterdir()}
    assert "built, and can be simulated" in " ".join(agvbench("doctor", "--agv=simavr", cwd=tmp_path).stdout.split())


@pytest.mark.slow
def test_init_and_bench_work_in_an_empty_folder(agvbench, tmp_path):
    made = agvbench("init", "lab", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    lab = tmp_path / "lab"
    assert {"vehicle.toml", "benchmarks", "trajectories", "noxfile.py", "README.md"} <= {p.name for p in lab.iterdir()}
    driven = agvbench("bench", "--vehicle=vehicle.toml", "--repeats=1", "--out=campaign", cwd=lab)
    assert driven.returncode == 0, driven.stdout + driven.stderr
    assert len(list((lab / "campaign" / "runs.parquet").glob("trajectory-*"))) == 14
    assert (lab / "campaign" / "report" / "report.html").stat().st_size > 100_000
    again = agvbench("init", "lab", cwd=tmp_path)
    assert again.returncode == 2
    assert again.stderr == "agvbench init: lab: exists already and is not empty; choose another folder\n"
