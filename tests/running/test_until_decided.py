"""``agvbench bench --until decided`` and ``--against``, on simulated campaigns of one trajectory."""

from __future__ import annotations

import json
import shutil
from xml.etree import ElementTree as ET

import pytest

from agvbench.campaign import Campaign
from agvbench.campaign.completeness import Completeness
from agvbench.cli import main
from agvbench.model import example_path
from agvbench.workflows.comparison.comparability import comparability
from agvbench.workflows.comparison.sequential_record import FILE, SequentialRecord

MINE = '''"""Trajectory 1 without calibration, for agvbench; ended by Ctrl-C in the run that the file `stop` names."""

from pathlib import Path

import pytest


@pytest.mark.repeats
@pytest.mark.trajectories
@pytest.mark.parametrize("condition", ["uncalibrated"])
def bench_mine(drive, request, trajectory, condition):
    if Path("stop").exists() and Path("stop").read_text() in request.node.name:
        raise KeyboardInterrupt
    drive.trajectory(trajectory, condition=condition)
'''
SLIPPED = '''"""The usual vehicle, whose front servo has slipped by 3°."""

from dataclasses import replace

from agvbench.simulator.plants import THESIS_VEHICLE
from agvbench.simulator.vehicle_plant import VehiclePlant


def make_plant(seed):
    front = replace(THESIS_VEHICLE.front, offset_rad=THESIS_VEHICLE.front.offset_rad + 0.05)
    return VehiclePlant(replace(THESIS_VEHICLE, front=front), seed)
'''
FAR = """schema = 1
name = "1"
conditions = ["uncalibrated"]
segments = [{ kind = "straight", length_m = 2.5 }]
"""
WIDE = ("--margin-mm=60", "--margin-deg=6")
NARROWER = ("--margin-mm=22", "--margin-deg=2")
REPEATS = 8


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """Return a folder with the campaign `a` of eight repeats."""
    folder = tmp_path_factory.mktemp("lab")
    (folder / "bench_mine.py").write_text(MINE)
    (folder / "slipped.py").write_text(SLIPPED)
    (folder / "far.toml").write_text(FAR)
    (folder / "own.toml").write_text(FAR.replace("2.5", "1.5").replace('"1"', '"own"'))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert bench("a", "--seed=1") == 0
    return folder


@pytest.fixture(autouse=True)
def in_lab(lab, monkeypatch):
    monkeypatch.chdir(lab)
    yield
    (lab / "stop").unlink(missing_ok=True)


def bench(out, *options):
    given = ["bench", "bench_mine.py", f"--repeats={REPEATS}", "--no-report", f"--out={out}", *options]
    chosen = [] if any(option.startswith("--trajectories") for option in options) else ["--trajectories=1"]
    return main([*given, *chosen])


def until_decided(out, *options):
    return bench(out, "--until=decided", "--against=a", "--seed=2", *options)


def analyses(out):
    return json.loads((out / FILE).read_text())["analyses"]


def test_the_same_vehicle_is_decided_before_the_last_repeat(lab, capsys):
    assert until_decided("same", *WIDE) == 0
    lines = capsys.readouterr().out.splitlines()
    record = SequentialRecord.load(lab / "same")
    driven = len(Campaign.open(lab / "same").run_ids)
    assert 3 <= driven == record.repeats < REPEATS
    analyses = [line for line in lines if line.startswith("after ")]
    assert len(analyses) == len(record.analyses)
    assert analyses[-1] == f"after {driven} of at most 8 repeats: 0 of 2 comparisons open; decided: no regression"
    assert f"{driven} runs of trajectories driven, {REPEATS - driven} saved" in " ".join(lines)


def test_a_decided_campaign_is_complete_and_says_how_it_ended(lab):
    until_decided("complete", *WIDE)
    decided = Campaign.open(lab / "complete")
    done = Completeness.of(decided)
    assert done.is_complete
    assert len(done.planned) == len(decided.run_ids)
    content = json.loads((lab / "complete" / FILE).read_text())
    assert content["decision"] == "no regression"
    assert content["plan"]["margins"] == {"position_mm": 60.0, "delta_heading_deg": 6.0}
    critical = content["bounds"]["same"]["critical_z"]
    assert len(critical) == len(content["analyses"])
    assert critical == sorted(critical, reverse=True)
    notes = comparability(Campaign.open(lab / "a"), decided).notes
    assert any("was driven until decided" in note and "too small" in note for note in notes)


def test_a_slipped_servo_is_a_regression(lab, capsys):
    assert until_decided("slipped", "--plant=slipped.py:make_plant", *WIDE, "--junitxml=slipped.xml") == 1
    assert "Regression: end position error of 1 uncalibrated" in " ".join(capsys.readouterr().out.split())
    driven = len(Campaign.open(lab / "slipped").run_ids)
    assert driven < REPEATS
    cases = list(ET.parse(lab / "slipped.xml").iter("testcase"))  # noqa: S314 - made above
    skipped = [case.find("skipped") for case in cases if case.find("skipped") is not None]
    assert len(skipped) == REPEATS - driven
    assert all("decided after" in case.get("message") for case in skipped)
    properties = {p.get("name"): p.get("value") for p in cases[0].iter("property")}
    assert float(properties["position_mm"]) > 100.0


@pytest.mark.slow
def test_margins_within_the_repeatability_are_not_decided(lab):
    assert until_decided("narrow", "--margin-mm=0.01", "--margin-deg=0.001", "--repeats=5") == 3
    assert len(Campaign.open(lab / "narrow").run_ids) == 5
    assert [analysis["repeats"] for analysis in analyses(lab / "narrow")] == [3, 4, 5]


@pytest.mark.slow
def test_an_interrupted_session_goes_on_as_if_it_had_not_been(lab, capsys):
    until_decided("whole", *NARROWER)
    (lab / "stop").write_text("r05")
    assert until_decided("parts", *NARROWER) == 130
    before = analyses(lab / "parts")
    assert [analysis["repeats"] for analysis in before] == [3, 4]
    assert not Completeness.of(Campaign.open(lab / "parts")).is_complete
    (lab / "stop").unlink()
    capsys.readouterr()
    assert main(["bench", "--resume", "--out=parts", "--no-report"]) == 0
    assert "after 4 of" not in capsys.readouterr().out  # what was analysed is not analysed again
    assert len(analyses(lab / "parts")) > len(before)
    assert analyses(lab / "parts") == analyses(lab / "whole")
    assert analyses(lab / "parts")[:2] == before
    assert Completeness.of(Campaign.open(lab / "parts")).is_complete


@pytest.mark.slow
def test_a_decided_session_that_is_resumed_drives_nothing(lab, capsys):
    until_decided("again", *WIDE)
    before = analyses(lab / "again")
    capsys.readouterr()
    assert main(["bench", "--resume", "--out=again", "--no-report"]) == 0
    assert "0 to drive" in capsys.readouterr().out
    assert analyses(lab / "again") == before
    assert Completeness.of(Campaign.open(lab / "again")).is_complete


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--margin-mm=7"], "--margin-mm: a resumed session keeps its margin: 7.0 (limit: 60.0)"),
        (["--against=begun"], "--against: a resumed session is compared with what it began with: begun"),
    ],
)
def test_a_resumed_session_keeps_its_plan(lab, options, message, capsys):
    if not (lab / "begun").exists():
        until_decided("begun", *WIDE)
    assert main(["bench", "--resume", "--out=begun", "--no-report", *options]) == 2
    assert message in capsys.readouterr().err


def test_until_cannot_be_added_to_a_session_that_began_without_it(capsys):
    assert main(["bench", "--resume", "--out=a", "--no-report", "--until=decided", "--against=a"]) == 2
    assert "--until: the session began without it: decided" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (["--until=decided"], 2, "--until: nothing to compare with: decided; give --against DIR"),
        (["--fail-on=any"], 2, "--fail-on: nothing to compare with: any; give --against DIR"),
        (["--until=decided", "--against=nowhere"], 2, "nowhere: does not exist"),
        (["--until=decided", "--against=a", "--order=blocked"], 2, "--order: has no rounds to analyse: blocked"),
        (["--until=decided", "--against=a", "--margin-deg=0"], 2, "--margin-deg: a margin of 0 is never shown"),
        (["--until=decided", "--against=a", "--repeats=1"], 2, "too few repeats to decide 2 comparisons: 8, against"),
        (["--until=decided", "--against=a", "--trajectories=far.toml"], 2, "nothing to compare: no trajectory under"),
        (["--until=decided", "--against=a", "--trajectories=5"], 2, "nothing to compare: no trajectory under"),
        (["--against=a", "--fail-on=worst"], 2, "--fail-on: is no rule of a gate: worst"),
        (
            ["--against=a", f"--vehicle={example_path('front_steered')}"],
            3,
            "The vehicles take commands in different units",
        ),
        (["--against=incomplete"], 3, "incomplete is incomplete: 8 runs planned, 7 driven, 1 missing"),
        (["--until=decided", "--against=incomplete"], 3, "incomplete is incomplete: 8 runs planned, 7 driven"),
    ],
)
def test_what_cannot_be_compared_is_said_before_anything_is_driven(lab, options, code, message, capsys, give_up):
    if not (lab / "incomplete").exists():
        shutil.copytree(lab / "a", lab / "incomplete")
        give_up(lab / "incomplete", "mine-1-uncalibrated-r05")
    assert bench("never", *options) == code
    errors = capsys.readouterr().err
    assert errors.count("ERROR") == 1
    assert message in errors
    assert not (lab / "never").exists()


def test_a_trajectory_of_ones_own_is_known_by_its_name_not_by_its_file(lab, capsys):
    mine = "--trajectories=own.toml"
    assert bench("own", mine) == 0
    assert bench("own-again", mine, "--until=decided", "--against=own", "--seed=2", *WIDE) == 0
    assert "0 of 2 comparisons open; decided: no regression" in capsys.readouterr().out


def test_until_takes_decided_only(capsys):
    assert bench("never", "--against=a", "--until=tomorrow") == 2
    assert "--until: invalid choice: 'tomorrow'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("rules", "code", "message"),
    [
        (["--fail-on=position_error.median>1mm"], 1, "1 of 1 checks failed"),
        (["--fail-on=position_error.median>1000mm,regression"], 0, "0 of 1 checks failed"),
        ([], 0, "No regression shown"),
    ],
)
def test_a_gate_decides_the_exit_code_of_a_bench(lab, rules, code, message, capsys):
    out = f"gate{code}{len(rules)}"
    assert bench(out, "--against=a", "--seed=3", *rules) == code
    assert message in " ".join(capsys.readouterr().out.split())
    assert Completeness.of(Campaign.open(lab / out)).is_complete
