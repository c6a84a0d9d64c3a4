from __future__ import annotations

import dataclasses
import json
import re

import numpy as np
import pytest
from tiny_vehicle import Tiny

from agvbench.cli import main
from agvbench.model import VehicleModel


@pytest.fixture(scope="module")
def adequate(tmp_path_factory, tiny_campaign, write_campaign):
    return write_campaign(tmp_path_factory.mktemp("adequate") / "campaign", tiny_campaign(Tiny()).runs)


def test_json_and_vehicle_of_a_whole_command(adequate, tmp_path, capsys):
    found, out = tmp_path / "new" / "d.json", tmp_path / "v.toml"
    assert main(["diagnose", str(adequate), "--json", str(found), "--out", str(out), "--check"]) == 0
    said, told = capsys.readouterr()
    assert said.startswith("ADEQUATE")
    assert said.splitlines()[-2:] == [f"wrote {found}", f"wrote {out}"]
    expected, *steps = told.splitlines()
    assert re.fullmatch(r"\d+ runs, about \d+ frames: takes \d+:\d\d to \d+:\d\d \(min:s\)", expected)
    assert steps
    assert all(re.fullmatch(r"\d+:\d\d  .+; \d+:\d\d to \d+:\d\d left", step) for step in steps)
    assert "repeatability" in said
    assert said.index("end position error [mm]") < said.index("Δs at the end [mm]")
    assert "position along the way [mm]" in said
    content = json.loads(found.read_text())
    assert content["schema"] == 1
    assert content["verdict"] == "ADEQUATE"
    assert set(content) == {
        "schema", "verdict", "effects", "unexplained", "held_out", "next_experiment", "states", "provenance"
    }  # fmt: skip
    assert content["unexplained"] == {"significant": False, "depends_on": []}
    end_pose = ["end_position_mm", "end_position_median_mm", "along_mm", "across_mm", "delta_heading_deg", "delta_s_mm"]
    assert list(content["held_out"]) == ["runs", *end_pose, "position_rms_mm", "heading_rms_deg", "worse_on"]
    assert all(set(content["held_out"][name]) == {"before", "after", "floor", "reproducibility"} for name in end_pose)
    model = VehicleModel.load(out)
    assert float(model.speed(900.0)) == pytest.approx(0.32, rel=0.01)
    assert float(model.front(1300.0)) == pytest.approx(0.274, abs=0.003)


@pytest.mark.slow
def test_the_same_campaign_gives_the_same_file(adequate, tmp_path):
    files = [tmp_path / name for name in ("a.json", "b.json")]
    for file in files:
        main(["diagnose", str(adequate), "--json", str(file)])
    assert files[0].read_bytes() == files[1].read_bytes()


def test_too_small_a_campaign_is_one_line(tmp_path, tiny_campaign, write_campaign, capsys):
    path = write_campaign(tmp_path / "small", tiny_campaign(Tiny()).runs[:5])
    assert main(["diagnose", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "too few runs to diagnose: 5 (limit: at least 20" in said


def test_no_campaign_is_one_line(tmp_path, capsys):
    assert main(["diagnose", str(tmp_path / "nowhere")]) == 2
    assert "does not exist" in capsys.readouterr().err


def test_runs_that_were_hardly_seen_are_left_out_and_counted(tiny_campaign):
    from agvbench.diagnosis.data.readings import read_runs

    runs = tiny_campaign(Tiny()).runs[:3]
    blind = dataclasses.replace(runs[0], frames=runs[0].frames.select(np.arange(5)))
    bad = dataclasses.replace(runs[1], status="rejected: bumped")
    readings = read_runs([blind, bad, runs[2]])
    assert [run.run_id for run in readings.runs] == [runs[2].run_id]
    assert readings.refused[bad.run_id] == "rejected: bumped"
    assert "too few frames" in readings.refused[blind.run_id]


def test_a_negative_seed_is_one_line(adequate, capsys):
    assert main(["diagnose", str(adequate), "--seed", "-1"]) == 2
    assert "--seed: must not be negative: -1" in capsys.readouterr().err
