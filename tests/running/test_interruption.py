"""Killed at random moments and resumed, a campaign ends up equal to one that nobody interrupted."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from agvbench.campaign import Campaign
from agvbench.running.configuration.campaign_directory import has_session

pytestmark = pytest.mark.real_time

KILLS = int(os.environ.get("AGVBENCH_KILLS", "8"))
"""Number of kills, each some seconds; AGVBENCH_KILLS=30 for a thorough test."""
PROGRAM = "import sys; from agvbench.cli import main; sys.exit(main())"
# Calibration and the eight trajectories, so that resuming in the middle of either is met.
OPTIONS = ["--repeats=1", "--seed=11", "--no-report"]


def start(directory: Path, *more: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", PROGRAM, "bench", *OPTIONS, f"--out={directory}", *more]
    return subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=directory.parent,
        # Who runs the tests in the background of a shell has SIGINT ignored, and so would what they start.
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509  (nothing else forks)
    )


def finish(process: subprocess.Popen[str]) -> str:
    output, _ = process.communicate(timeout=300)
    assert process.returncode == 0, output
    return output


def parts(directory: Path) -> dict[str, bytes]:
    return {
        f"{table}/{path.name}": path.read_bytes()
        for table in ("runs", "commands", "poses")
        for path in sorted((directory / f"{table}.parquet").iterdir())
    }


def run_parts(directory: Path) -> set[str]:
    # A part that was being written when the process died has a name of its own until it is whole.
    return {path.name for path in (directory / "runs.parquet").glob("[!.]*.parquet")}


def until_another_run_is_finished(process: subprocess.Popen[str], directory: Path, so_far: int) -> None:
    while len(run_parts(directory)) <= so_far and process.poll() is None:
        time.sleep(0.005)


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    directory = tmp_path_factory.mktemp("whole") / "campaign"
    finish(start(directory))
    return parts(directory)


@pytest.mark.slow
def test_killed_many_times_nothing_finished_is_lost_and_the_end_is_the_same(uninterrupted, tmp_path):
    rng = np.random.default_rng(20150621)
    directory = tmp_path / "campaign"
    finished: set[str] = set()
    for _ in range(KILLS):
        process = start(directory, *(["--resume"] if has_session(directory) else []))
        if rng.random() < 0.7:
            until_another_run_is_finished(process, directory, len(finished))
            time.sleep(rng.uniform(0.0, 0.15))
        else:
            time.sleep(rng.uniform(0.2, 4.0))
        process.kill()
        process.communicate()
        now = run_parts(directory)
        assert finished <= now
        finished = now
        if finished:
            campaign = Campaign.open(directory).check()
            assert len(campaign) == len(finished)
    assert len(finished) > KILLS / 3, "kills must fall into driving, not only before it"
    finish(start(directory, "--resume"))
    assert parts(directory) == uninterrupted


@pytest.mark.slow
def test_interrupt_stops_the_vehicle_keeps_the_run_as_aborted_and_can_be_resumed(uninterrupted, tmp_path):
    directory = tmp_path / "campaign"
    for number, more, code in ((signal.SIGINT, [], 130), (signal.SIGTERM, ["--resume"], 143)):
        process = start(directory, *more)
        until_another_run_is_finished(process, directory, len(run_parts(directory)) + 1)
        process.send_signal(number)
        output, _ = process.communicate(timeout=60)
        assert process.returncode == code
        assert "Traceback" not in output
        assert f"the vehicle was stopped; go on with --resume --out {directory.name}\n" in output
    finish(start(directory, "--resume"))
    successful = {name: data for name, data in parts(directory).items() if "-aborted" not in name}
    assert successful == uninterrupted


@pytest.mark.slow
def test_resuming_with_another_seed_is_refused_in_one_line(tmp_path):
    directory = tmp_path / "campaign"
    first = start(directory, "-k", "bench_drive and r01 and 0.0")
    finish(first)
    second = start(directory, "--resume", "--seed=12")
    output, _ = second.communicate(timeout=60)
    assert second.returncode == 2
    assert "--seed: a resumed session drives what it began with: 12 (limit: 11); leave --seed out" in output
