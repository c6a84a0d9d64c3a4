"""The loop from the outside: what it leaves, what it says, and how it goes on."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
from dataclasses import replace

import pandas as pd
import pytest

from agvbench.campaign import Campaign
from agvbench.errors import FileError, FlagError
from agvbench.loop.before_after import before_after, end_positions
from agvbench.loop.settings import MODEL_ONLY, NO_TRIAL, opened, write
from agvbench.loop.stages import learned
from agvbench.model import VehicleModel
from agvbench.reporting.loop_report import before_after_table, end_position_table
from agvbench.running.configuration.settings import BenchSettings
from agvbench.running.session.end_pose_bias import read_bias_corrections
from agvbench.statistics.equivalence import Bias
from agvbench.statistics.quantities import THESIS

PROGRAM = "import sys; from agvbench.cli import main; sys.exit(main())"


def loop(folder, *options):
    command = [sys.executable, "-c", PROGRAM, "loop", *options]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)


def test_help_teaches(tmp_path):
    said = loop(tmp_path, "--help")
    assert said.returncode == 0
    for word in ("before/", "diagnosis.json", "vehicle.toml", "plans.json", "after/", "report.html", "--resume"):
        assert word in said.stdout
    assert "--corrected" not in said.stdout


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--plant=nosuch:plant", "--out=x"], "agvbench loop: nosuch: there is no such module"),
        (["--repeats=0", "--out=x"], "agvbench loop: --repeats: value cannot be used: 0"),
        (["--resume", "--out=x"], "agvbench loop: x/loop.toml: no loop to resume"),
        (["--resume"], "agvbench loop: --resume: no loop to resume: none in campaigns/"),
        (["--trajectories=garag", "--out=x"], "agvbench loop: there is no trajectory 'garag'; did you mean 'garage'?"),
        (["--vehicle=missing.toml", "--out=x"], "agvbench loop: missing.toml: cannot read the vehicle file"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(tmp_path, options, line):
    said = loop(tmp_path, *options)
    assert said.returncode == 2
    assert said.stderr.startswith(line)
    assert said.stderr.count("\n") == 1
    assert not (tmp_path / "x").exists()


def test_a_loop_is_not_written_over(tmp_path):
    directory, settings = opened({"repeats": 3, "seed": 4, "plant": None}, str(tmp_path / "a"), resume=False)
    with pytest.raises(FlagError, match=r"^--out: exists already and is not empty: .*; go on with --resume$"):
        opened({}, str(directory), resume=False)
    assert opened({}, str(directory), resume=True) == (directory, settings)
    assert settings.repeats == 3
    with pytest.raises(FlagError, match=r"^--seed: a resumed session drives what it began with: 5 \(limit: 4\)"):
        opened({"seed": 5}, str(directory), resume=True)
    (directory / "loop.toml").write_text("speed = 3\n")
    with pytest.raises(FileError, match=r"not the settings of a loop"):
        opened({}, str(directory), resume=True)


def test_the_last_loop_goes_on(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    directory, settings = opened({"seed": 9}, None, resume=False)
    assert directory.name.startswith("loop-")
    assert opened({}, None, resume=True) == (directory, settings)


def test_a_file_is_whole_or_not_there(tmp_path):
    write(tmp_path / "a.json", "{}")
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]
    with pytest.raises(FileError):
        write(tmp_path / "missing" / "a.json", "{}")


def test_a_bias_across_alone_is_beyond():
    rows = [
        {"trajectory": "1", "condition": condition, "status": "ok", "problem": "", "position_mm": abs(across),
         "along_mm": off, "across_mm": across, "delta_heading_deg": off, "delta_s_mm": off}
        for condition, bias in (("calibrated", 90.0), ("corrected", 60.0))
        for off in (-1.0, 0.5, 1.0, -0.5) * 5
        for across in [bias + off]
    ]  # fmt: skip
    errors = pd.DataFrame(rows)
    found = before_after(errors)
    assert {row.quantity.column: row.corrected.verdict for row in found} == {
        "along_mm": Bias.WITHIN, "across_mm": Bias.BEYOND, "delta_heading_deg": Bias.WITHIN,
    }  # fmt: skip
    assert all(row.corrected.verdict is Bias.WITHIN for row in before_after(errors, THESIS))
    (end,) = end_positions(errors)
    assert end.median_mm == {"calibrated": 90.0, "corrected": 60.0}
    assert end.delta_s["corrected"].bias == 0.0
    assert [row[-1] for row in before_after_table(found).rows] == ["within", "beyond", "within"]
    assert end_position_table([end]).rows[0][:3] == ["1", 90.0, 0.0]


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    folder = tmp_path_factory.mktemp("loop")
    said = loop(folder, "--plant=agvbench.simulator.hidden:lateral_slip", "--seed=3", "--repeats=3", "--out=it")
    assert said.returncode == 0, said.stderr
    return folder / "it", said.stdout


def table(directory):
    with (directory / "tables" / "before_after.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_the_correction_takes_the_bias_away(driven):
    directory, said = driven
    rows = table(directory)
    assert len(rows) == 24
    for error in ("along mm", "across mm", "heading error deg"):
        biases = {
            c: [abs(float(row[f"{c}_bias"])) for row in rows if row["error"] == error]
            for c in ("calibrated", "corrected")
        }
        assert max(biases["corrected"]) < 0.2 * max(biases["calibrated"])
    stages = ("1/5 driving", "2/5 diagnosing", "3/5 trying", "4/5 planning", "5/5 driving")
    for line in (*stages, "report: it/report.html"):
        assert line in said
    assert "lateral_slip" in said
    assert "Median end position error, mean over trajectories: uncalibrated" in said


@pytest.mark.slow
def test_everything_is_there_and_fits_together(driven):
    directory, _ = driven
    diagnosis = json.loads((directory / "diagnosis.json").read_text())
    model = VehicleModel.load(directory / "vehicle.toml")
    assert {effect["name"] for effect in diagnosis["effects"]} == {effect.name for effect in model.effects}
    plans = json.loads((directory / "plans.json").read_text())["plans"]
    assert list(plans) == [str(k) for k in range(1, 9)]
    assert all(abs(plan["remaining"]["along_mm"]) < 0.5 for plan in plans.values())
    html = (directory / "report.html").read_text()
    for heading in ("Before and after", "What the calibrated model lacks", "What corrected plans compensate"):
        assert heading in html
    assert not list(directory.glob(".*"))


@pytest.mark.slow
def test_what_is_tried_is_not_what_is_compared(driven):
    directory, _ = driven
    tried, compared = (list(Campaign.open(directory / name)) for name in ("trial", "after"))
    assert {run.condition for run in tried} == {"corrected"}
    assert len(tried) == 8 * 3
    # All randomness of a simulated run follows from its name: the same names would mean the same scatter.
    assert not {run.run_id for run in tried} & {run.run_id for run in compared}
    first, then = (
        read_bias_corrections(str(directory / f"{name}.json")) for name in ("remainders-before", "remainders")
    )
    assert set(first) == set(then)
    assert first != then


@pytest.mark.slow
def test_less_may_be_learned(driven, tmp_path):
    directory = shutil.copytree(driven[0], tmp_path / "it")
    settings, said = BenchSettings.load(directory / "before"), []
    assert learned(directory, replace(settings, remainders=MODEL_ONLY), said.append) == ""
    shutil.rmtree(directory / "trial")
    (directory / "remainders.json").unlink()
    known = learned(directory, replace(settings, remainders=NO_TRIAL), said.append)
    assert read_bias_corrections(known) == read_bias_corrections(str(directory / "remainders-before.json"))
    assert not (directory / "trial").exists()
    assert [line.partition(": ")[2] for line in said] == ["--model-only", "--no-trial"]


@pytest.mark.slow
def test_resumed_it_ends_as_it_did(driven, tmp_path, give_up):
    directory, _ = driven
    again = tmp_path / "it"
    shutil.copytree(directory, again)
    rows = table(again)
    # Moved and gone on with, it drives what it lacks: one run.
    lost = next((again / "after" / "runs.parquet").glob("*8-corrected-r03*"))
    give_up(again / "after", lost.stem)
    moved = loop(tmp_path, "--out=it", "--resume")
    assert moved.returncode == 0, moved.stderr
    assert table(again) == rows
    shutil.rmtree(again / "after")
    (again / "plans.json").unlink()
    said = loop(tmp_path, "--out=it", "--resume")
    assert said.returncode == 0, said.stderr
    assert "as found before" in said.stdout
    assert table(again) == rows
