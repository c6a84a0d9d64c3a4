"""A challenge goes on where it was interrupted."""

from __future__ import annotations

import dataclasses
import json
import os
import re
import signal
import subprocess
from pathlib import Path

import pytest
import stand_ins

from agvbench.challenge import campaigns, challenge
from agvbench.challenge.campaigns import TrialKind, drive_campaign, driven_campaign
from agvbench.challenge.challenge import PAIRS, everything, hold_trial, known_trials, run_challenge, write_trials
from agvbench.challenge.trial import Trial
from agvbench.cli import main
from agvbench.errors import FileError, FitError, FlagError, PlantError
from agvbench.executors import ExecutorOptions
from agvbench.model import VehicleModel
from agvbench.simulator.hidden.catalogue import CATALOGUE, catalogue

LAG = Trial(
    "steering_lag", 3, "library", ("steering_lag",), ("steering_lag",), (), False, False,
    {"steering_lag": {"time_constant_s": 0.1}}, "NAMED", ("steering_lag",), (), ("x_m",),
    {"steering_lag": {"time_constant_s": (0.11, float("nan"))}}, {"before": 9.0, "after": 1.0, "floor": 1.0},
)  # fmt: skip


def same(a, b):
    return repr(dataclasses.asdict(a)) == repr(dataclasses.asdict(b))


def test_what_was_written_is_known_again(tmp_path):
    file = tmp_path / "deep" / "challenge.json"
    write_trials(file, TrialKind(5), [LAG])
    found = known_trials(file, TrialKind(5))
    assert list(found) == [("steering_lag", 3)]
    assert same(found["steering_lag", 3], LAG)
    assert not list(file.parent.glob("*.part"))


def test_trials_that_the_file_holds_are_not_held_again(tmp_path, capsys):
    file = tmp_path / "challenge.json"
    write_trials(file, TrialKind(5), [LAG])
    before = file.read_bytes()
    flags = ["--first-seed=3", "--only", "steering_lag", "--jobs=1", f"--json={file}", "--resume"]
    assert main(["challenge", *flags]) == 0
    assert file.read_bytes() == before
    shown = capsys.readouterr().out
    assert "1 blind trials" in shown
    assert "1 × NAMED steering_lag" in shown


@pytest.mark.parametrize("content", ["", "[]", '{"each": [{"spec": 1}], "repeats": 5}', '{"repeats": 5}'])
def test_another_file_is_told_in_one_line(tmp_path, content):
    file = tmp_path / "challenge.json"
    file.write_text(content)
    with pytest.raises(FileError, match="holds no challenge") as caught:
        known_trials(file, TrialKind(5))
    assert "\n" not in str(caught.value)


def test_other_repeats_are_told(tmp_path):
    file = tmp_path / "challenge.json"
    write_trials(file, TrialKind(5), [LAG])
    assert json.loads(file.read_text())["repeats"] == 5
    with pytest.raises(FileError, match="other repeats"):
        known_trials(file, TrialKind(4))


@pytest.mark.parametrize(("was", "asked"), [("two_axle", "differential"), ("differential", "two_axle")])
def test_other_kinematics_are_told_in_one_line_and_nothing_is_driven(tmp_path, capsys, was, asked):
    file = tmp_path / "challenge.json"
    write_trials(file, TrialKind(5, was), [LAG])
    before = file.read_bytes()
    flags = ["--first-seed=3", "--only", "steering_lag", "--jobs=1", f"--json={file}", "--resume"]
    assert main(["challenge", *flags, f"--kinematics={asked}"]) == 2
    said = capsys.readouterr().err.strip()
    assert f"has trials with other kinematics: {was} (limit: --kinematics {asked})" in said
    assert "\n" not in said
    assert file.read_bytes() == before


def test_a_file_of_differential_vehicles_states_so_and_is_known_again(tmp_path):
    file = tmp_path / "challenge.json"
    write_trials(file, TrialKind(5, "differential"), [LAG])
    assert json.loads(file.read_text())["kinematics"] == "differential"
    assert same(known_trials(file, TrialKind(5, "differential"))["steering_lag", 3], LAG)
    write_trials(file, TrialKind(5), [LAG])
    assert "kinematics" not in json.loads(file.read_text())


def test_what_such_a_vehicle_cannot_hide_is_told(capsys):
    assert main(["challenge", "--kinematics=differential", "--only", "axle_coupling"]) == 2
    assert "--only: no such hidden effect: axle_coupling" in capsys.readouterr().err
    assert main(["challenge", "--only", "wheel_lag"]) == 2


def test_by_default_everything_is_hidden_that_a_vehicle_of_its_kind_can_have():
    two_axle, differential = everything("two_axle"), everything("differential")
    assert two_axle[: len(CATALOGUE) + 1] == ("nothing", *CATALOGUE)
    assert two_axle[len(CATALOGUE) + 1 :] == PAIRS[:7]
    assert "steering_lag_and_lateral_slip" in differential
    assert "wheel_lag_and_wheel_diameter_mismatch" in differential
    assert not any("axle_coupling" in spec or "servo" in spec for spec in differential)
    assert {name for spec in differential[1:] for name in spec.split("_and_")} == set(catalogue("differential"))


def test_a_differential_vehicle_is_driven_with_a_vehicle_file_of_its_kind(tmp_path, monkeypatch):
    began = benches(monkeypatch, (0, ""), (0, ""))
    drive_campaign("wheel_lag", 3, TrialKind(5, "differential"), tmp_path)
    drive_campaign("steering_lag", 3, TrialKind(5), tmp_path)
    vehicle = next(o for o in began[0] if o.startswith("--vehicle=")).partition("=")[2]
    assert VehicleModel.load(vehicle).geometry.is_differential
    assert "--plant=agvbench.simulator.hidden.differential:wheel_lag" in began[0]
    assert not any(o.startswith("--vehicle") for o in began[1])
    assert "--plant=agvbench.simulator.hidden:steering_lag" in began[1]


def test_to_resume_without_a_file_is_told():
    with pytest.raises(FlagError, match="--resume"):
        run_challenge(1, first_seed=0, specs=[], repeats=5, jobs=1, json_file=None, resume=True)


def one_that_fails(spec, seed, repeats):
    """Stand in for a trial, in the processes that hold them: the third cannot be held."""
    Path(os.environ["HELD"], f"{seed}").touch()
    if seed == 2:
        raise RuntimeError(spec)
    return dataclasses.replace(LAG, spec=spec, seed=seed)


def test_what_was_held_before_a_trial_that_fails_is_kept_and_no_other_is_begun(tmp_path, monkeypatch):
    (tmp_path / "held").mkdir()
    monkeypatch.setenv("HELD", str(tmp_path / "held"))
    monkeypatch.setattr(challenge, "hold_trial", one_that_fails)
    file = tmp_path / "challenge.json"
    with pytest.raises(RuntimeError, match="steering_lag"):
        run_challenge(40, first_seed=0, specs=["steering_lag"], repeats=5, jobs=1, json_file=str(file))
    assert sorted(known_trials(file, TrialKind(5))) == [("steering_lag", 0), ("steering_lag", 1)]
    assert len(list((tmp_path / "held").iterdir())) <= 4


def test_a_trial_that_ended_with_an_error_is_held_again(tmp_path, monkeypatch):
    (tmp_path / "held").mkdir()
    monkeypatch.setenv("HELD", str(tmp_path / "held"))
    monkeypatch.setattr(challenge, "hold_trial", one_that_fails)
    file = tmp_path / "challenge.json"
    write_trials(file, TrialKind(5), [dataclasses.replace(LAG, verdict="ERROR", named=())])
    run_challenge(1, first_seed=3, specs=["steering_lag"], repeats=5, jobs=1, json_file=str(file), resume=True)
    assert (tmp_path / "held" / "3").exists()
    assert same(known_trials(file, TrialKind(5))["steering_lag", 3], LAG)


def benches(monkeypatch, *ends):
    """Let benches end so, one after another; return the commands that began them."""
    coming, began = list(ends), []

    def run(command, **_):
        began.append(command)
        code, said = coming.pop(0)
        return subprocess.CompletedProcess(command, code, "", said)

    monkeypatch.setattr(campaigns.subprocess, "run", run)
    return began


def test_a_bench_that_fails_is_a_trial_that_cannot_be_driven_and_rejected_runs_are_none(tmp_path, monkeypatch):
    began = benches(monkeypatch, (1, ""))
    drive_campaign("nothing", 3, TrialKind(5), tmp_path)
    assert "--resume" not in began[0]
    began = benches(monkeypatch, (2, "ERROR: the disk is full"), (0, ""))
    with pytest.raises(PlantError, match=r"could not drive.*disk is full"):
        drive_campaign("nothing", 3, TrialKind(5), tmp_path)
    assert len(began) == 1


def test_a_campaign_that_was_kept_is_not_driven_again(tmp_path, monkeypatch):
    def bench(command, **_):
        began.append(command)
        directory = Path(next(o for o in command if o.startswith("--out=")).partition("=")[2])
        directory.mkdir()
        (directory / "campaign.toml").write_text(command[-2])
        return subprocess.CompletedProcess(command, 0, "", "")

    began: list[list[str]] = []
    monkeypatch.setattr(campaigns.subprocess, "run", bench)
    kind = TrialKind(5, campaigns=tmp_path)
    for _ in range(2):
        with driven_campaign("nothing", 3, kind) as directory:
            assert (directory / "campaign.toml").exists()
    assert len(began) == 1
    with driven_campaign("nothing", 3, TrialKind(4, campaigns=tmp_path)) as other:
        assert other != directory
    with driven_campaign("nothing", 3, TrialKind(5)) as unkept:
        assert unkept.exists()
    assert not unkept.exists()
    assert {path.name for path in tmp_path.iterdir()} == {directory.name, other.name}


def test_a_campaign_that_could_not_be_driven_is_not_kept(tmp_path, monkeypatch):
    benches(monkeypatch, (2, "ERROR: the disk is full"))
    with pytest.raises(PlantError), driven_campaign("nothing", 3, TrialKind(5, campaigns=tmp_path)):
        pass
    assert not list(tmp_path.iterdir())


def test_a_file_in_the_place_of_the_folder_for_campaigns_is_told(tmp_path, capsys):
    (tmp_path / "file").touch()
    assert main(["challenge", "--only=nothing", f"--campaigns={tmp_path / 'file'}"]) == 2
    assert "--campaigns" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "cause"),
    [
        (FitError("nothing to fit", where="run 7"), r"run 7: nothing to fit"),
        (KeyError("steering_lag"), r"KeyError: 'steering_lag' \(test_challenge_file.py, line \d+, in fails\)"),
    ],
)
def test_a_diagnosis_that_fails_is_an_answer_that_counts_as_wrong(monkeypatch, error, cause):
    def fails(_):
        raise error

    monkeypatch.setattr(campaigns, "drive_campaign", lambda *_: None)
    monkeypatch.setattr("agvbench.campaign.Campaign.open", lambda _: None)
    monkeypatch.setattr("agvbench.diagnosis.diagnose", fails)
    trial = hold_trial("nothing", 3, TrialKind(5))
    assert trial.verdict == "ERROR"
    assert re.fullmatch(cause, trial.error)


def one_without_an_answer(spec, seed, _):
    """Stand in for a trial, in the process that holds it."""
    return dataclasses.replace(LAG, spec=spec, seed=seed, verdict="ERROR", named=(), error="the disk is full")


def test_a_trial_without_an_answer_is_told_with_its_cause_and_by_the_exit_code(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(challenge, "hold_trial", one_without_an_answer)
    file = tmp_path / "challenge.json"
    assert main(["challenge", "--first-seed=3", "--only", "steering_lag", "--jobs=1", f"--json={file}"]) == 1
    shown = capsys.readouterr().out
    assert "ended with an error, which counts as a wrong answer: 1" in shown
    assert "steering_lag, seed 3: the disk is full" in shown
    content = json.loads(file.read_text())
    assert content["errors"] == ["steering_lag, seed 3: the disk is full"]
    assert content["each"][0]["error"] == "the disk is full"
    assert known_trials(file, TrialKind(5))["steering_lag", 3].error == "the disk is full"


def test_a_plant_that_cannot_be_driven_is_an_answer_that_counts_as_wrong(monkeypatch):
    def fails(*_):
        raise PlantError("the bench could not drive this plant")

    monkeypatch.setattr(campaigns, "drive_campaign", fails)
    assert hold_trial("steering_lag", 3, TrialKind(5)).verdict == "ERROR"


def one_that_kills_its_worker(spec, seed, _):
    """Stand in for a trial that takes all memory, in the process that holds it."""
    if seed == 4:
        os.kill(os.getpid(), signal.SIGKILL)
    return dataclasses.replace(LAG, spec=spec, seed=seed)


@pytest.mark.slow
def test_a_trial_whose_worker_dies_again_and_again_is_an_answer_that_counts_as_wrong(tmp_path, monkeypatch):
    monkeypatch.setattr(challenge, "hold_trial", one_that_kills_its_worker)
    file = tmp_path / "challenge.json"
    scores = run_challenge(2, first_seed=4, specs=["steering_lag"], repeats=5, jobs=2, json_file=str(file))
    assert scores.errors == ("steering_lag, seed 4: process was killed by SIGKILL, 4 times",)
    assert same(known_trials(file, TrialKind(5))["steering_lag", 5], dataclasses.replace(LAG, seed=5))


@pytest.mark.real_time
def test_the_file_of_a_cluster_is_that_of_one_process(tmp_path, monkeypatch, dask_cluster):
    monkeypatch.setattr(challenge, "hold_trial", stand_ins.trial)
    found = []
    for where, jobs in ((ExecutorOptions(), 1), (ExecutorOptions(), 2), (ExecutorOptions(dask_cluster.address), None)):
        file = tmp_path / "challenge.json"
        run_challenge(
            4, first_seed=0, specs=["steering_lag", "nothing"], repeats=5, jobs=jobs, json_file=str(file), cluster=where
        )
        found.append(file.read_bytes())
    assert found[0] == found[1] == found[2]
    assert len(json.loads(found[0])["each"]) == 8


def timeless(file):
    """Return a file's content without the times, which no two runs share: one for each trial, and their summary."""
    content = json.loads(file.read_text())
    assert content.pop("seconds")
    assert all(trial.pop("seconds") > 0.0 for trial in content["each"])
    return content


@pytest.mark.slow
@pytest.mark.real_time
def test_real_trials_of_a_cluster_are_those_of_one_process_but_for_their_times(tmp_path, dask_cluster):
    found = []
    for more in (["--jobs=1"], [f"--cluster={dask_cluster.address}"]):
        file = tmp_path / f"{len(found)}.json"
        assert main(["challenge", "--only", "nothing", "--repeats=2", f"--json={file}", *more]) == 0
        found.append(timeless(file))
    assert found[0] == found[1]
