"""Sweeps of real bench sessions: on processes and on Dask workers, interrupted, kept, diagnosed, with failures."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest

import agvbench
from agvbench.cli import main
from agvbench.metrics.table import by_run, read_metrics
from agvbench.workflows.sweep.cell import MARK

pytestmark = [pytest.mark.slow, pytest.mark.real_time]
GRID = """
benchmarks = ["trajectories"]

[fixed]
trajectories = "1"
repeats = 1
exchange = 2.0
calibration = "vehicle.toml"

[grid]
seed = "1..2"

[grid.plant_option]
speed_scatter = [0.0, 0.05]
"""
PROGRAM = "import sys; from agvbench.cli import main; sys.exit(main())"
PLANT = """
import os
from pathlib import Path
from agvbench.simulator import make_plant as thesis_plant

class Breaks:
    def __init__(self, plant): self.plant = plant
    def reset(self, pose, *, seed): self.plant.reset(pose, seed=seed)
    def advance(self, *command):
        if not Path(os.environ["REPAIRED"]).exists(): os._exit(3)
        return self.plant.advance(*command)

def make_plant(seed, *, breaks: bool = False):
    return Breaks(thesis_plant(seed)) if breaks else thesis_plant(seed)
"""


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """A folder with a grid of four cells of two runs each."""
    from agvbench.model import example_path

    folder = tmp_path_factory.mktemp("lab")
    (folder / "vehicle.toml").write_bytes(example_path("thesis").read_bytes())
    (folder / "grid.toml").write_text(GRID)
    return folder


@pytest.fixture(scope="module")
def serial(lab):
    """The sweep of the grid, a cell at a time; campaigns are kept."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(lab)
        assert main(["sweep", "grid.toml", "--out", "serial", "--jobs", "1", "--keep"]) == 0
    return lab / "serial"


@pytest.fixture(autouse=True)
def in_lab(lab, monkeypatch):
    monkeypatch.chdir(lab)


def tables(folder):
    return [(folder / name).read_bytes() for name in ("results.parquet", "results.csv")]


def test_the_table_has_the_medians_of_the_campaigns_and_their_hashes(serial):
    frame = pq.read_table(serial / "results.parquet").to_pandas()
    assert frame[["cell", "seed", "plant_option.speed_scatter"]].drop_duplicates().to_numpy().tolist() == [
        [0, 1, 0.0], [1, 1, 0.05], [2, 2, 0.0], [3, 2, 0.05]
    ]  # fmt: skip
    for cell in range(4):
        campaign = serial / "campaigns" / f"{cell:07d}"
        errors = by_run(read_metrics(campaign))
        rows = frame[frame["cell"] == cell]
        for row in rows.to_dict("records"):
            runs = errors[(errors["trajectory"] == row["trajectory"]) & (errors["condition"] == row["condition"])]
            assert row["n"] == len(runs)
            assert row["position_error_mm"] == runs["position_error"].abs().median()
        hashed = subprocess.run(["sha256sum", campaign / "errors.parquet"], capture_output=True, text=True, check=True)
        assert set(rows["sha256"]) == {hashed.stdout.split()[0]}
        assert sorted(rows["condition"]) == ["calibrated", "uncalibrated"]
        assert f"speed_scatter={(0.0, 0.05)[cell % 2]}" in (campaign / "bench.toml").read_text()
    assert frame["sha256"].nunique() == 4


def test_processes_and_dask_workers_write_the_bytes_of_a_serial_sweep(serial, lab, dask_cluster):
    assert main(["sweep", "grid.toml", "--out", "processes", "--jobs", "2"]) == 0
    assert main(["sweep", "grid.toml", "--out", "cluster", "--cluster", dask_cluster.address]) == 0
    assert tables(lab / "processes") == tables(serial)
    assert tables(lab / "cluster") == tables(serial)
    order = [line.split(b",")[0] for line in (lab / "cluster" / MARK).read_bytes().splitlines()]
    assert sorted(order[1:]) == [b'{"cell":%d' % n for n in range(4)]
    assert not (lab / "cluster" / "campaigns").exists()


def test_an_interrupted_sweep_goes_on_and_ends_with_the_same_bytes(serial, lab):
    record = lab / "stopped" / MARK
    command = [sys.executable, "-c", PROGRAM, "sweep", "grid.toml", "--out", "stopped", "--jobs", "1"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 600
    while not record.exists() or record.read_bytes().count(b"\n") < 2:
        assert time.monotonic() < end
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert said == "agvbench sweep: interrupted: 1 of 4 cells are recorded; go on with --resume\n"
    with record.open("ab") as file:
        file.write(record.read_bytes().splitlines()[1][:100])  # the power failed while a line was written
    done = record.read_bytes().splitlines()[1]
    frame = agvbench.sweep("grid.toml", "stopped", jobs=2, resume=True)
    assert tables(lab / "stopped") == tables(serial)
    assert record.read_bytes().splitlines()[1] == done
    assert frame.attrs == {"failed": {}}
    assert len(frame) == 8


def test_a_cell_that_fails_is_listed_and_driven_again_on_resume(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("REPAIRED", str(tmp_path / "repaired"))
    Path("my_plant.py").write_text(PLANT)
    Path("grid.toml").write_text(
        'benchmarks = ["trajectories"]\n[fixed]\ntrajectories = "1"\nrepeats = 1\nexchange = 2.0\n'
        'plant = "my_plant.py:make_plant"\n[grid.plant_option]\nbreaks = [true, false]'
    )
    assert main(["sweep", "grid.toml", "--out", "s", "--jobs", "2"]) == 1
    shown = capsys.readouterr().out
    assert "failed: cell 0 (plant_option.breaks=True): agvbench bench ended with exit code 3" in shown
    assert "1 of 2 cells have a result" in shown
    assert set(pq.read_table("s/results.parquet").column("cell").to_pylist()) == {1}
    Path("repaired").touch()
    assert main(["sweep", "grid.toml", "--out", "s", "--jobs", "1", "--resume"]) == 0
    assert "2 of 2 cells have a result" in capsys.readouterr().out
    assert set(pq.read_table("s/results.parquet").column("cell").to_pylist()) == {0, 1}
    assert os.environ["REPAIRED"]


def test_a_diagnosis_of_each_cell_has_its_columns(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("grid.toml").write_text(
        'benchmarks = ["trajectories"]\n[fixed]\ntrajectories = "1"\nrepeats = 2\nexchange = 2.0\n[grid]\nseed = [1]'
    )
    frame = agvbench.sweep("grid.toml", "s", jobs=1, diagnose=True)
    assert set(frame["verdict"]) <= {"ADEQUATE", "NAMED", "AMBIGUOUS", "UNKNOWN", "NOT_IDENTIFIABLE"}
    assert "named" in frame
