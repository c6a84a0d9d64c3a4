"""A session that is resumed without its options drives what it began with, and nothing else."""

from __future__ import annotations

import dataclasses
import os
import platform
import re
import shutil
import subprocess
import sys
from types import SimpleNamespace

import pytest

from agvbench.campaign import Campaign
from agvbench.campaign.completeness import Completeness
from agvbench.errors import CampaignError, FileError, FlagError, LinkError, PlanError
from agvbench.model import VehicleModel, example_path, thesis_vehicle
from agvbench.planning.trajectories.loading import trajectory_file
from agvbench.running.configuration.benchmark_files import benchmark_name, find_benchmark
from agvbench.running.configuration.campaign_directory import shown
from agvbench.running.execution.calibration import VEHICLE_FILE
from agvbench.running.execution.run_records import attempts_by_run
from agvbench.running.positioning.placers import PLACERS, Auto
from agvbench.running.session.driver import NotDrivenError
from agvbench.running.session.opening import open_session
from agvbench.vehicle.channels import Channels
from agvbench.workflows.bench import run_benchmarks

MINE = """'''Two turns, for agvbench.'''

import pytest


@pytest.mark.grid("share", [0.5], [0.5, 1.0])
@pytest.mark.repeats(None)
def bench_left(drive, share):
    drive.hold(drive=1.0, front=share, rear=0.0, for_s=0.3)


@pytest.mark.repeats(None)
def bench_right(drive):
    drive.hold(drive=1.0, front=-0.5, rear=0.0, for_s=0.3)
"""
BEGAN = ["bench_mine.py", "--repeats=2", "--order=shuffled", "--full", "-k=left"]


@pytest.fixture
def lab(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bench_mine.py").write_text(MINE)
    return tmp_path


def bench(*arguments):
    program = "import sys; from agvbench.cli import main; sys.exit(main())"
    command = [sys.executable, "-c", program, "bench", "--out=c", "--no-report", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ)


@pytest.mark.slow
def test_what_was_chosen_is_chosen_again(lab, give_up):
    assert bench(*BEGAN).returncode == 0
    first = {run.run_id for run in Campaign.open(lab / "c")}
    assert len(first) == 4
    give_up(lab / "c", "left-1-r02")
    resumed = bench("--resume")
    assert resumed.returncode == 0, resumed.stdout + resumed.stderr
    assert {run.run_id for run in Campaign.open(lab / "c")} == first


@pytest.mark.slow
def test_progress_of_a_resumed_session_counts_what_is_left(lab, give_up):
    assert "1/4 runs" in bench(*BEGAN).stdout
    for run_id in ("left-1-r02", "left-0.5-r01"):
        give_up(lab / "c", run_id)
    shown_ = [line for line in bench("--resume").stdout.splitlines() if " elapsed " in line]
    assert [re.search(r"\d+/\d+ runs", line)[0] for line in shown_] == ["1/2 runs"]


def test_a_run_that_lost_the_vehicle_is_rejected_and_driven_again(lab, give_up):
    lost = bench("bench_mine.py", "--repeats=2", "--seed=7", "-k=left", "--camera=untracked=0.003,burst_frames=60")
    assert lost.returncode == 0, lost.stdout + lost.stderr
    runs = {run.run_id: run for run in Campaign.open(lab / "c")}
    (again,) = [name for name in runs if name.endswith("-attempt2")]
    stopped = runs.pop(again.removesuffix("-attempt2"))
    assert re.fullmatch(
        r"rejected: stopped \d.\d s into the run: tracking was lost: not seen for 0.5.*", stopped.status
    )
    assert {run.status for run in runs.values()} == {"ok"}
    tables = [lab / "c" / f"{table}.parquet" / f"{again}.parquet" for table in ("runs", "commands", "poses")]
    before = [table.read_bytes() for table in tables]
    give_up(lab / "c", again)
    assert bench("--resume").returncode == 0
    assert [table.read_bytes() for table in tables] == before


def test_a_vehicle_that_is_never_seen_ends_the_session(tmp_path):
    given = {"vehicle": "", "mocap": "impaired:silent:sim"}
    with open_session(given, out=str(tmp_path / "c"), resume=False, dry_run=False) as session:
        with pytest.raises(LinkError, match="the vehicle is not seen: in 3 runs in succession; look at camera"):
            session.driver("left", experiment="free", repeat=1).hold(drive=0.5, for_s=0.3)
        assert session.failure is not None
    assert [path.name for path in sorted((tmp_path / "c" / "runs.parquet").iterdir())] == [
        "left-attempt2.parquet", "left-attempt3.parquet", "left.parquet",
    ]  # fmt: skip


def test_one_that_drives_back_itself_begins_at_other_random_numbers_too(tmp_path, monkeypatch):
    class Placed(Auto):
        def place(self, start, run_id):
            asked.append(run_id)
            return super().place(start, run_id)

    asked: list[str] = []
    monkeypatch.setitem(PLACERS, "auto", Placed)
    monkeypatch.setattr("agvbench.running.execution.bench.times_stopped", lambda *_: 2)
    with open_session({"place": "auto"}, out=str(tmp_path / "c"), resume=False, dry_run=False) as session:
        session.driver("left", experiment="free", repeat=1).hold(drive=0.5, front=0.5, rear=0.0, for_s=0.3)
    assert asked == ["left-again2"]


@pytest.mark.parametrize(
    ("changed", "line"),
    [
        (
            Channels.alike("us", 1480.0),
            "the vehicle stands still at another command than its file says: 1480.0 (limit: 1500.0)",
        ),
        (Channels.alike("normalised"), "the vehicle takes commands in another unit than its file says: normalised"),
    ],
)
@pytest.mark.slow
def test_a_model_of_another_vehicle_is_refused_before_anything_moves(lab, changed, line):
    dataclasses.replace(thesis_vehicle(), channels=changed).save(lab / "other.toml")
    for option in ("--calibration", "--corrected"):
        said = bench("trajectories", "-k=calibrated", f"{option}=other.toml")
        assert said.returncode == 2
        assert line in said.stdout + said.stderr
        assert f"give the right file with {option}" in said.stdout + said.stderr
        assert not (lab / "c" / "runs.parquet").exists()


@pytest.mark.slow
def test_more_benchmarks_may_be_asked_for_than_it_began_with(lab):
    assert bench(*BEGAN).returncode == 0
    assert bench("--resume", "bench_mine.py").returncode == 0
    assert len(list(Campaign.open(lab / "c"))) == 6


def test_there_must_be_something_to_resume(lab):
    with pytest.raises(FlagError, match="no session to resume"):
        run_benchmarks([], {"resume": True})


@pytest.mark.parametrize("name", ["calibration", "endurance"])
def test_a_shipped_benchmark_is_known_by_its_name(name, lab):
    assert benchmark_name(str(find_benchmark(name))) == name


def test_one_of_your_own_is_known_by_its_path_unless_it_lies_in_benchmarks(lab):
    assert benchmark_name("bench_mine.py") == "bench_mine.py"
    (lab / "benchmarks").mkdir()
    (lab / "bench_mine.py").rename(lab / "benchmarks" / "bench_mine.py")
    assert benchmark_name("benchmarks/bench_mine.py") == "mine"
    assert benchmark_name("benchmarks/bench_mine.py::bench_left") == "benchmarks/bench_mine.py::bench_left"


def test_runs_are_recorded_where_out_was_given_whatever_the_working_directory_becomes(lab, monkeypatch):
    (lab / "elsewhere").mkdir()
    with open_session({}, out="c", resume=False, dry_run=False) as session:
        monkeypatch.chdir("elsewhere")
        session.driver("left", experiment="free", repeat=1).hold(drive=0.5, front=0.5, rear=0.0, for_s=0.3)
        assert shown(session.directory) == lab / "c"
        monkeypatch.chdir(lab)
        assert str(shown(session.directory)) == "c"
    assert Campaign.open(lab / "c").run_ids == ["left"]


def test_two_sessions_cannot_record_to_one_directory(lab):
    holder = f"process {os.getpid()} on {platform.node()}"
    with (
        open_session({}, out="c", resume=False, dry_run=False),
        pytest.raises(CampaignError, match=f"^c: another session is recording to it: {holder}; wait until it ends"),
        open_session({}, out="c", resume=True, dry_run=False),
    ):
        pass
    with open_session({}, out="c", resume=True, dry_run=False):  # released, whatever ended the first
        pass


def test_attempts_belong_to_the_planned_run_whose_id_they_carry():
    names = ["left", "left-attempt2", "left-attempt3-aborted1", "left-attempts", "right-aborted1"]
    attempts = attempts_by_run(SimpleNamespace(run_id=name) for name in names)
    found = {planned: [run.run_id for run in runs] for planned, runs in attempts.items()}
    assert found == {"left": names[:3], "left-attempts": ["left-attempts"], "right": ["right-aborted1"]}


def test_what_was_planned_and_the_calibration_belong_to_the_campaign(lab):
    rear = VehicleModel.load(example_path("front_steered")).rear
    dataclasses.replace(thesis_vehicle(), rear=rear).save(lab / "cal.toml")
    given = {"vehicle": "cal.toml", "calibration": "cal.toml"}
    plan = [
        {"run_id": name, "experiment": "free", "trajectory": "", "condition": "", "repeat": 1}
        for name in ("left", "crab", "right")
    ]
    with open_session(given, out="c", resume=False, dry_run=False, plan=plan) as session:
        session.driver("left", experiment="free", repeat=1).hold(drive=0.5, front=0.5, rear=0.0, for_s=0.3)
        with pytest.raises(NotDrivenError):
            session.driver("crab", experiment="free", repeat=1).hold(drive=0.5, front=0.5, rear=0.5, for_s=0.3)
    campaign = Campaign.open(lab / "c")
    done = Completeness.of(campaign)
    assert done is not None
    assert (done.planned, done.missing) == (("left", "right"), ("right",))
    assert (lab / "c" / VEHICLE_FILE).read_bytes() == (lab / "cal.toml").read_bytes()
    assert set(campaign.table("inputs")["input"]) == {"--vehicle", "--calibration"}


def test_a_trajectory_that_changes_in_a_session_is_not_driven(lab):
    own = lab / "own.toml"
    shutil.copy(trajectory_file("5"), own)
    with open_session({}, out="c", resume=False, dry_run=False) as session:
        session.trajectory("own.toml")
        own.write_text(own.read_text() + "# another\n")
        with pytest.raises(FileError, match=r"^own.toml: has changed since the session began \(trajectory own.toml\)"):
            session.trajectory("own.toml")


def test_a_run_that_has_no_plan_here_is_not_missing(lab):
    names = ("left", "far", "far-again", "long")
    plan = [{"run_id": n, "experiment": "t", "trajectory": "", "condition": "", "repeat": 1} for n in names]
    with open_session({"workspace": "rectangle:2x2"}, out="c", resume=False, dry_run=False, plan=plan) as session:
        session.driver("left", experiment="free", repeat=1).hold(drive=0.5, front=0.5, rear=0.0, for_s=0.3)
        for name, error in (("far", PlanError), ("far-again", NotDrivenError)):
            with pytest.raises(error):
                session.driver(name, experiment="t", repeat=1).trajectory("1", condition="uncalibrated")
        with pytest.raises(NotDrivenError):
            session.driver("long", experiment="free", repeat=1).hold(drive=1.0, for_s=60.0)
    done = Completeness.of(Campaign.open(lab / "c"))
    assert done is not None
    assert (done.planned, done.missing) == (("left",), ())


def test_the_campaigns_copy_stands_in_for_a_calibration_that_is_gone_unless_it_was_changed(lab):
    thesis_vehicle().save(lab / "cal.toml")
    with open_session({"calibration": "cal.toml"}, out="c", resume=False, dry_run=False):
        pass
    (lab / "cal.toml").unlink()
    with open_session({}, out="c", resume=True, dry_run=False) as session:
        assert "calibration: the campaign's copy c/vehicle.toml, since the file given before is gone" in session.notices
        assert session.model("calibrated") == thesis_vehicle()
    copy = lab / "c" / VEHICLE_FILE
    copy.write_text(copy.read_text() + "# another\n")
    with (
        pytest.raises(FileError, match=r"c/vehicle.toml: has changed since the session began"),
        open_session({}, out="c", resume=True, dry_run=False),
    ):
        pass


@pytest.mark.parametrize(
    "changed", ["cal.toml", "mine.py", "trajectories/own.toml", "trajectories/body.toml", "bench_mine.py"]
)
def test_a_session_is_not_resumed_with_files_of_other_content(lab, changed):
    thesis_vehicle().save(lab / "cal.toml")
    (lab / "mine.py").write_text("from agvbench.simulator import make_plant as make\n")
    (lab / "trajectories").mkdir()
    for name in ("own", "body"):
        shutil.copy(trajectory_file("5"), lab / "trajectories" / f"{name}.toml")
    given = {"calibration": "cal.toml", "plant": "mine.py:make", "benchmarks": ("bench_mine.py",)}
    plan = [{"run_id": "x", "experiment": "t", "trajectory": "own", "condition": "calibrated", "repeat": 1}]
    with open_session(given, out="c", resume=False, dry_run=False, plan=plan) as session:
        session.trajectory("body")  # in the body of a benchmark
    with open_session({}, out="c", resume=True, dry_run=False, plan=plan):
        pass
    (lab / changed).write_text((lab / changed).read_text() + "# another\n")
    with (
        pytest.raises(FileError, match=rf"{changed}: has changed since the session began \(.+\); restore it"),
        open_session({}, out="c", resume=True, dry_run=False, plan=plan),
    ):
        pass
