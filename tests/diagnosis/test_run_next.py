from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
from tiny_vehicle import HEADER, Tiny, campaign_runs

from agvbench.campaign import Campaign, CampaignWriter
from agvbench.cli import main
from agvbench.diagnosis.data.readings import read_runs
from agvbench.diagnosis.data.splits import split_runs
from agvbench.planning import load_trajectory
from agvbench.running.configuration.settings import BenchSettings
from agvbench.workflows.run_next import _options


@pytest.fixture(scope="module")
def unexcited(tmp_path_factory):
    """A campaign whose steering never changed while driving."""
    path = tmp_path_factory.mktemp("next") / "campaign"
    writer = CampaignWriter.create(path, HEADER, durable=False)
    for run in campaign_runs(Tiny(), steps=False):
        writer.append(run)
    return path


def _digest(path: Path) -> dict[str, str]:
    return {str(f): hashlib.sha256(f.read_bytes()).hexdigest() for f in sorted(path.rglob("*")) if f.is_file()}


@pytest.mark.slow
def test_the_next_run_is_driven_and_added_to_a_copy(unexcited, tmp_path, capsys):
    before = _digest(unexcited)
    proposed, found = tmp_path / "next.toml", tmp_path / "d.json"
    out = tmp_path / "extended"
    arguments = ["diagnose", str(unexcited), "--run-next", "--next-out", str(out), "--next", str(proposed)]
    plant = ["--plant", "agvbench.simulator:make_plant", "--plant-seed", "3", "--json", str(found)]
    assert main([*arguments, *plant]) == 0
    assert _digest(unexcited) == before
    trajectory = load_trajectory(str(proposed))
    assert main(["plan", str(proposed)]) == 0
    old, new = Campaign.open(unexcited), Campaign.open(out)
    added = [run for run in new if run.run_id not in set(old.run_ids)]
    assert [run.trajectory for run in added] == [trajectory.name] * 4
    assert {run.session for run in added} == {"next1"}
    assert {run.split for run in added} == {"fit"}
    readings = read_runs(list(old), HEADER.neutral)
    split = split_runs(readings.runs, readings.group, HEADER.neutral, 0)
    names = dict(zip((run.run_id for run in readings.runs), split.names, strict=True))
    assert {run.run_id: run.split for run in new} == names | {run.run_id: "fit" for run in added}
    assert set(names.values()) == {"fit", "validation", "held_out"}
    assert min(run.started_s for run in added) > max(run.started_s for run in old)
    assert len({round(run.frames.heading_rad[0], 1) for run in added}) == 4
    assert (out / "driven" / "campaign.toml").exists()
    assert json.loads(found.read_text())["provenance"]["runs_used"] == len(old) + 4
    assert "drove next_excitation" in capsys.readouterr().out


def test_an_occupied_directory_is_refused_before_anything_drives(unexcited, tmp_path, capsys):
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "note.txt").write_text("mine")
    assert main(["diagnose", str(unexcited), "--run-next", "--next-out", str(tmp_path / "kept")]) == 2
    assert "is occupied" in capsys.readouterr().err
    assert [f.name for f in (tmp_path / "kept").iterdir()] == ["note.txt"]


def test_a_campaign_that_can_tell_nothing_gets_a_first_run(tmp_path):
    path = tmp_path / "campaign"
    writer = CampaignWriter.create(path, HEADER, durable=False)
    seen = set()
    for run in campaign_runs(Tiny(), steps=False):  # no repeats
        if (key := run.run_id.split("-", 1)[1]) not in seen:
            seen.add(key)
            writer.append(run)
    proposed = tmp_path / "first.toml"
    assert main(["diagnose", str(path), "--next", str(proposed), "--json", str(tmp_path / "d.json")]) == 0
    content = json.loads((tmp_path / "d.json").read_text())
    assert content["verdict"] == "NOT_IDENTIFIABLE"
    assert content["next_experiment"]["repeats"] >= 2
    assert load_trajectory(str(proposed)).name == "next_slalom"


def test_the_next_run_is_driven_with_the_rig_of_the_campaign_and_chosen_by_the_diagnosis(tmp_path):
    rig = {"mocap": "natnet:lab", "camera": "up=z", "place": "operator", "bus_config": "b.json5", "vehicle_name": "red"}
    BenchSettings(**rig, repeats=7, corrected="c.toml", benchmarks=("trial",), full=True, session="mon").save(tmp_path)
    options = _options(tmp_path, {"place": "auto", "agv": None})
    assert {name: options[name] for name in rig} == {**rig, "place": "auto"}
    assert not {"repeats", "corrected", "benchmarks", "full", "only", "session"} & options.keys()
