"""The built wheel, alone in an empty folder, lays out a lab and drives in it."""

from __future__ import annotations

import os
import site
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

from agvbench.adapters.simavr.firmware_files import missing_packages

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel that people install."""
    out = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(out)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return next(out.glob("*.whl"))


@pytest.fixture(scope="module")
def agvbench(wheel, tmp_path_factory):
    """The command of an environment that has the wheel and this environment's dependencies, not this checkout."""
    root = tmp_path_factory.mktemp("environment")
    venv.create(root, with_pip=False)
    packages = next((root / "lib").glob("python3*")) / "site-packages"
    zipfile.ZipFile(wheel).extractall(packages)
    # Only third-party packages: an editable install of the checkout would hide what the wheel lacks.
    dependencies = root / "dependencies"
    dependencies.mkdir()
    for entry in Path(site.getsitepackages()[0]).iterdir():
        if not entry.name.startswith(("agvbench", "_agvbench", "__editable__", "_editable")):
            (dependencies / entry.name).symlink_to(entry)
    # As a site directory: packages there may have files of paths themselves.
    (packages / "dependencies.pth").write_text(f"import site; site.addsitedir({str(dependencies)!r})")
    python = root / "bin" / "python"

    def run(*arguments, cwd):
        environment = {k: v for k, v in os.environ.items() if not k.startswith(("COV_", "PYTEST"))}
        command = [str(python), "-c", "import sys; from agvbench.cli import main; sys.exit(main())", *arguments]
        return subprocess.run(
            command, check=False, cwd=cwd, env=environment, capture_output=True, text=True, timeout=300
        )

    return run


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
