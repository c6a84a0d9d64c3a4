"""The grid of a sweep: which cells it has, and what is wrong with one that cannot be used."""

from __future__ import annotations

import re

import pytest

from agvbench.cli import main
from agvbench.errors import FileError
from agvbench.workflows.sweep.axes import as_text
from agvbench.workflows.sweep.grid import read_grid
from agvbench.workflows.sweep.lab_files import LabFiles
from agvbench.workflows.sweep.run import flags

PLANT = """
import os

class Still:
    def reset(self, pose, *, seed): self.pose = pose
    def advance(self, drive, front, rear, dt): return self.pose

def make_plant(seed, *, grip: float = 1.0, wheels: int = 4):
    return Still()
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_plant.py").write_text(PLANT)
    return tmp_path


def grid(folder, text):
    (folder / "grid.toml").write_text(text)
    return read_grid(folder / "grid.toml")


def test_cells_are_all_combinations_and_the_last_axis_is_the_fastest(folder):
    found = grid(
        folder,
        """
        benchmarks = ["trajectories"]
        [fixed]
        trajectories = ["1", "5"]
        camera = { rate_hz = 60 }
        plant_option = "backlash_m=0.01"
        [grid]
        seed = "3..5"
        full = [false, true]
        [grid.plant_option]
        understeer_s2_per_m2 = [0, 0.5]
        [grid.camera]
        lost = [0.0]
        """,
    )
    assert len(found) == 12
    assert [found.values(n) for n in (0, 1, 2, 11)] == [
        (3, False, 0, 0.0), (3, False, 0.5, 0.0), (3, True, 0, 0.0), (5, True, 0.5, 0.0)
    ]  # fmt: skip
    assert len({found.values(n) for n in range(12)}) == 12
    assert flags(found.options(11)) == (
        "--trajectories=1,5", "--camera=rate_hz=60,lost=0.0",
        "--plant-option=backlash_m=0.01,understeer_s2_per_m2=0.5", "--seed=5", "--full",
    )  # fmt: skip
    assert "--full" not in flags(found.options(0))


def test_a_million_cells_take_no_memory_and_lists_and_ranges_mix(folder):
    found = grid(folder, '[grid]\nseed = "0..999999"\nrepeats = ["1..3", 10]')
    assert len(found) == 4_000_000
    assert found.values(3_999_999) == (999_999, 10)
    assert isinstance(found.axes[0].values, range)
    assert found.axes[1].values == (1, 2, 3, 10)


def test_parameters_of_a_plant_of_ones_own_have_the_types_that_it_declares(folder):
    text = '[fixed]\nplant = "my_plant.py:make_plant"\n[grid.plant_option]\ngrip = [0.5, 1]\nwheels = "3..4"'
    assert list(map(grid(folder, text).values, range(4))) == [(0.5, 3), (0.5, 4), (1, 3), (1, 4)]
    with pytest.raises(FileError, match=r"grid: plant_option.wheels: --plant-option: wheels cannot .*: '4.5' \(limit"):
        grid(folder, text.replace('"3..4"', "[4, 4.5]"))


WRONG = {
    "": "grid.toml: grid: has no axis; add a list, such as seed = \"1..20\"",
    "[grid]\nseed = []": "grid.toml: grid: seed: has too many values or none: 0 (limit: 1 to 1000000)",
    "[grid]\nseed = 3": "grid.toml: grid: seed: value cannot be used: 3 (limit: a list, or a range as 1..20)",
    "[grid]\nsed = [1]": "grid.toml: grid: sed: no such option of the bench; did you mean 'seed'? known: agv, mocap,",
    "[grid]\nseed = [1.5]": "grid.toml: grid: seed: value cannot be used: 1.5 (limit: a whole number)",
    "[grid]\nseed = [true]": "grid.toml: grid: seed: value cannot be used: True (limit: a whole number)",
    "[grid]\nseed = [1, 1]": "grid.toml: grid: seed: has a value twice; leave it out",
    "[grid]\nseed = ['5..1']": "grid.toml: grid: seed: range cannot be used: 5..1 (limit: 1 to 1000000 values, rising)",
    "[grid]\nseed = '0..999999999999'": "grid.toml: grid: seed: range cannot be used: 0..999999999999 (limit: 1 to",
    "[grid]\nseed = '-5..1'": "grid.toml: grid: seed: --seed: value cannot be used: -5 (limit: 0 to 9223372036",
    "[grid]\nmaps = ['spline']": "grid.toml: grid: maps: --maps: value cannot be used: spline (one of: default",
    "[grid]\nrepeats = '0..3'": "grid.toml: grid: repeats: --repeats: value cannot be used: 0 (limit: 1 to 1000)",
    "[fixed]\nseed = 'one'\n[grid]\nrepeats = [1]": "grid.toml: fixed: seed: value cannot be used: 'one' (limi",
    "[fixed]\nseed = 1\n[grid]\nseed = [2]": "grid.toml: is in [fixed] and in [grid]: seed; leave it out of one",
    "[fixed]\ncamera = 'lost=0.1'\n[grid.camera]\nlost = [0.0]": "grid.toml: is in [fixed] and in [grid]: camera.lost;",
    "[fixed]\nconnect = 'tcp/1.2.3.4:1'\n[grid]\nseed = [1]": "grid.toml: fixed: connect: is not for a sweep,",
    "[grid]\nagv = ['serial:/dev/ttyACM0']": "grid.toml: grid: agv: --agv: a sweep drives simulated vehicles o",
    "[grid]\nmocap = ['natnet:1.2.3.4']": "grid.toml: grid: mocap: --mocap: a sweep drives simulated vehicles",
    "[grid.camera]\nlosst = [1]": "grid.toml: grid: camera.losst: camera: unknown option: 'losst' (one of:",
    "[grid.plant_option]\nmass = [1]": "grid.toml: grid: plant_option.mass: --plant-option: not an option of agvbench.",
    "[grid.plant_option]\nbacklash_m = [9]": "grid.toml: grid: plant_option.backlash_m: agvbench.simulator:mak",
    "[grid.plant_option]\nbacklash_m = ['a,b']": "grid.toml: grid.plant_option: backlash_m: value cannot be us",
    "[grid.plant_option]\n'a b' = [1]": "grid.toml: grid.plant_option: a b: is not the name of a parameter: 'a b'",
    "[grid]\nplant = ['nope.py:x']": "grid.toml: grid: plant: nope.py: there is no such file; write MODULE:FACTORY or",
    "[grid]\nvehicle = ['nope.toml']": "grid.toml: grid: vehicle: nope.toml: cannot read the vehicle file",
    "benchmarks = ['nosuch']\n[grid]\nseed = [1]": "grid.toml: benchmarks: no such benchmark: nosuch (one of:",
    "benchmarks = []\n[grid]\nseed = [1]": "grid.toml: benchmarks: names no benchmark; leave it out for the usual ones",
    "[grids]\nseed = [1]": "grid.toml: unknown key 'grids'; did you mean 'grid'? known: benchmarks, fixed, grid",
    "grid = 3": "grid.toml: grid: value cannot be used: 3 (limit: a table)",
    "grid =": "grid.toml: is no grid that can be read: Invalid value (at end of document); see agvbench sweep --help",
    "[grid]\nseed = '0..999999'\nrepeats = '1..1000'": "grid.toml: has too many cells: 1000000000 (limit: 10000000);",
}  # fmt: skip


@pytest.mark.parametrize("text", WRONG)
def test_what_cannot_be_swept_is_one_line_that_names_its_place(text, folder, capsys):
    (folder / "grid.toml").write_text(text)
    assert main(["sweep", "grid.toml", "--out", "s"]) == 2
    line = capsys.readouterr().err
    assert line.startswith(f"agvbench sweep: {WRONG[text]}")
    assert line.count("\n") == 1
    assert not (folder / "s").exists()


def test_a_missing_grid_bad_jobs_and_a_full_directory_are_one_line(folder, capsys):
    assert main(["sweep", "none.toml", "--out", "s"]) == 2
    assert "none.toml: is no grid that can be read: No such file or directory" in capsys.readouterr().err
    (folder / "grid.toml").write_text("[grid]\nseed = [1]")
    assert main(["sweep", "grid.toml", "--out", "s", "--jobs", "0"]) == 2
    assert "--jobs: is too small: 0 (limit: at least 1)" in capsys.readouterr().err
    assert main(["sweep", "grid.toml", "--out", ".", "--jobs", "1"]) == 2
    assert "exists already and is not empty; add --resume" in capsys.readouterr().err
    assert main(["sweep", "grid.toml", "--out", "s", "--resume"]) == 2
    assert "--resume --out: no sweep to resume: s; leave out --resume" in capsys.readouterr().err
    assert main(["sweep", "grid.toml", "--out", "s", "--cluster", "tcp://10.0.0.1:8786"]) == 2
    assert "--cluster: a program that answers at this address can run code here" in capsys.readouterr().err
    assert not (folder / "s").exists()


def test_a_dry_run_says_which_cells_there_are_and_drives_none(folder, capsys):
    (folder / "grid.toml").write_text(
        '[fixed]\nrepeats = 2\n[grid]\nseed = "1..20"\n[grid.camera]\nrate_hz = [60, 120]'
    )
    assert main(["sweep", "grid.toml", "--out", "s", "--dry-run"]) == 0
    shown = capsys.readouterr().out
    assert "40 cells" in shown
    assert re.search(r"camera.rate_hz +2 +60 +120", shown)
    assert "agvbench bench calibration trajectories --repeats=2 --seed=1 --camera=rate_hz=60" in shown.replace(
        "\n", " "
    )
    assert not (folder / "s").exists()


def test_files_that_decide_what_is_driven_are_found_hashed_and_required(folder):
    text = "[grid]\nseed = [1]"
    assert LabFiles.of(grid(folder, text), folder) is None
    (folder / "metrics").mkdir()
    (folder / "metrics" / "mine.py").write_text("own = 1\n")
    (folder / "neighbour.py").write_text("")
    own = LabFiles.of(grid(folder, text), folder)
    assert own.files == ("metrics/mine.py",)
    plant = LabFiles.of(grid(folder, f'{text}\nplant = ["my_plant.py:make_plant"]'), folder)
    assert plant.files == ("metrics/mine.py", "my_plant.py", "neighbour.py")
    module = LabFiles.of(grid(folder, f'{text}\nplant = ["my_plant:make_plant"]'), folder)
    assert module.files == ("metrics/mine.py", "my_plant.py")
    plant.require_here()
    (folder / "neighbour.py").write_text("changed = True\n")
    with pytest.raises(Exception, match=f"{folder}: worker does not have the files of the sweep's folder"):
        plant.require_here()
    (folder / "my_plant.py").unlink()
    with pytest.raises(Exception, match="worker does not have the files"):
        module.require_here()


def test_equal_grids_have_one_digest_and_others_another(folder):
    digests = {
        grid(folder, text).digest
        for text in (
            "[grid]\nseed = [1, 2]", "[grid]\nseed = '1..2'", "[grid]\nseed = ['1..2']", "[grid]\nseed = [2, 1]",
            "[fixed]\nrepeats = 3\n[grid]\nseed = [1, 2]", "benchmarks = ['endurance']\n[grid]\nseed = [1, 2]",
        )
    }  # fmt: skip
    assert len(digests) == 4
    assert as_text(False) == "false"
