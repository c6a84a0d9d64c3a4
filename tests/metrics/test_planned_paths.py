"""The path that a run was to drive: at the times of its own commands, whatever the calibration moved by micrometres."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from agvbench.campaign import Campaign
from agvbench.metrics.planned_paths import _SAME_TARGET, PlannedPaths, _steering
from agvbench.model import example_path
from agvbench.statistics.matching import same_target
from agvbench.types import NO_TARGET, Pose


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    out = tmp_path_factory.mktemp("planned") / "campaign"
    options = ["--repeats", "1", "--trajectories", "1,5", "--exchange", "2", "--no-report", "--out", str(out)]
    calibrated = ["--calibration", str(example_path("thesis"))]
    command = [sys.executable, "-m", "agvbench", "bench", "trajectories", *options, *calibrated]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return Campaign.open(out)


def _runs(campaign):
    return {(run.trajectory, run.condition): run for run in campaign if run.experiment == "trajectory"}


def test_each_condition_has_the_same_path_at_the_times_of_its_commands(campaign):
    runs, paths = _runs(campaign), PlannedPaths(campaign)
    for trajectory in ("1", "5"):
        uncalibrated, calibrated = (runs[trajectory, name] for name in ("uncalibrated", "calibrated"))
        nominal, fitted = paths.of(uncalibrated), paths.of(calibrated)
        np.testing.assert_array_equal(nominal[:, 1:], fitted[:, 1:])
        assert nominal[-1, 0] == pytest.approx(uncalibrated.commands.t_s[-1])
        assert fitted[-1, 0] == pytest.approx(calibrated.commands.t_s[-1])
        assert abs(nominal[-1, 0] - fitted[-1, 0]) > 0.01


def test_a_target_that_a_calibration_moved_by_a_tenth_of_a_millimetre_is_the_same(campaign):
    run, paths = _runs(campaign)["5", "uncalibrated"], PlannedPaths(campaign)
    moved, other = (replace(run, target=run.target._replace(x_m=run.target.x_m + by)) for by in (1e-4, 1e-2))
    assert paths.of(moved) is not None
    assert paths.of(other) is None


def test_half_a_turn_is_the_same_to_either_side():
    target = Pose(1.0, 0.0, math.pi)
    assert same_target(target, target._replace(heading_rad=1e-4 - math.pi), _SAME_TARGET)
    assert not same_target(target, target._replace(heading_rad=0.1 - math.pi), _SAME_TARGET)
    assert same_target(NO_TARGET, NO_TARGET, _SAME_TARGET)
    assert not same_target(target, NO_TARGET, _SAME_TARGET)


def test_a_bench_that_steered_every_trajectory_in_a_mode_has_its_paths(tmp_path):
    options = ["--repeats", "1", "--trajectories", "5", "--steering", "front", "--exchange", "2", "--no-report"]
    calibrated = ["--calibration", str(example_path("thesis")), "--conditions", "calibrated"]
    command = [sys.executable, "-m", "agvbench", "bench", "trajectories", *options, *calibrated, "--out", "c"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    (run,) = (run for run in Campaign.open(tmp_path / "c") if run.experiment == "trajectory")
    assert PlannedPaths(Campaign.open(tmp_path / "c")).of(run) is not None


@pytest.mark.parametrize(
    ("settings", "mode"),
    [(None, ""), (b"\xff steering", ""), (b'steering = "no"', ""), (b'steering = "front"', "front")],
)
def test_a_campaign_of_another_program_has_no_settings_of_a_bench(tmp_path, settings, mode):
    if settings is not None:
        (tmp_path / "bench.toml").write_bytes(settings)
    assert _steering(SimpleNamespace(path=tmp_path)) == mode
