"""Whole runs with a known truth: angles, speed, what is steady, and honest standard errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from calibration_samples import FRONT_M, REAR_M, Vehicle, frames_of, held, run_of, steady_poses

from agvbench.calibration import measure_run
from agvbench.calibration.measurement.windows import command_spread
from agvbench.errors import FitError
from agvbench.types import Commands, Frames
from agvbench.vehicle.geometry import Geometry

GEOMETRY = Geometry(FRONT_M, REAR_M)
T = np.arange(0, 6.5, 1 / 120)


def steady_run(front, rear, speed, seed=0, noise_m=5e-4, noise_rad=4e-3, drive=900):
    poses = steady_poses(front, rear, speed, np.maximum(T - 0.5, 0))
    return run_of(held(drive, 1400, 1500), frames_of(T, poses, np.random.default_rng(seed), noise_m, noise_rad))


MOTIONS = {
    "left": (0.5, 0.0), "right": (-0.5, 0.05), "rear": (0.0, 0.4), "opposite": (0.6, -0.6), "crab": (0.3, 0.3),
    "straight": (0.0, 0.0), "nearly straight": (-0.03, -0.035), "same way": (0.5, 0.2),
}  # fmt: skip


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("speed", [0.32, -0.32, 0.06, -0.06])
def test_angles_and_speed_within_their_standard_errors(name, speed):
    front, rear = MOTIONS[name]
    found = [measure_run(steady_run(front, rear, speed, seed), GEOMETRY) for seed in range(6)]
    for name_, true in (("front", front), ("rear", rear)):
        value = np.array([getattr(m, f"{name_}_rad") for m in found])
        stderr = np.array([getattr(m, f"{name_}_stderr_rad") for m in found])
        assert np.all(np.abs(value - true) < 4 * stderr)
        assert np.all(stderr < np.radians(0.3 if abs(speed) < 0.1 else 0.05))
    speeds = np.array([m.speed_mps for m in found])
    assert np.all(np.abs(speeds - speed) < [4 * m.speed_stderr_mps for m in found])
    assert all(m.speed_stderr_mps < 1e-4 for m in found)


def test_standard_errors_mean_what_they_say():
    found = [measure_run(steady_run(0.35, -0.1, 0.2, seed), GEOMETRY) for seed in range(150)]
    for name, true in (("front", 0.35), ("rear", -0.1)):
        z = np.array([(getattr(m, f"{name}_rad") - true) / getattr(m, f"{name}_stderr_rad") for m in found])
        assert 0.7 < np.sqrt(np.mean(z**2)) < 1.25
    z = np.array([(m.speed_mps - 0.2) / m.speed_stderr_mps for m in found])
    assert 0.6 < np.sqrt(np.mean(z**2)) < 1.25


def test_from_frame_to_frame_noise_adds_up_and_here_it_does_not():
    run = steady_run(0.3, 0.0, 0.1)
    moving = run.frames.select(run.frames.t_s > 0.5)
    ds = np.hypot(np.diff(moving.x_m), np.diff(moving.y_m))
    thesis = np.median(ds / np.diff(moving.t_s))
    assert thesis > 1.1 * 0.1
    assert measure_run(run, GEOMETRY).speed_mps == pytest.approx(0.1, rel=1e-3)


def test_all_frames_beat_the_last_frame_alone():
    front = []
    for seed in range(30):
        measured = measure_run(steady_run(0.35, -0.1, 0.3, seed), GEOMETRY)
        front.append(measured.front_rad - 0.35)
    assert np.sqrt(np.mean(np.square(front))) < 4e-3 / 5  # one heading alone is 4e-3 off


def dirty(frames, rng):
    """Lose, double, delay, untrack and displace one frame in thirty each."""
    n = len(frames)
    pick = lambda: rng.random(n) < 1 / 30  # noqa: E731
    x, y, heading, tracked = frames.x_m.copy(), frames.y_m.copy(), frames.heading_rad.copy(), frames.tracked.copy()
    wrong = pick()
    x[wrong] += rng.uniform(-3, 3, n)[wrong]
    heading[wrong] = rng.uniform(-3, 3, n)[wrong]
    lost = pick()
    tracked[lost], y[lost] = False, np.nan
    frames = replace(frames, x_m=x, y_m=y, heading_rad=heading, tracked=tracked)
    order = np.argsort(np.arange(n) + 3.5 * pick(), kind="stable")
    order = np.sort(np.concatenate([order[~pick()], np.flatnonzero(pick())])) if rng.random() < 0.5 else order
    return frames.select(order)


def test_lost_doubled_late_untracked_and_wildly_wrong_frames_hardly_matter():
    for seed in range(10):
        run = steady_run(0.4, -0.2, 0.3, seed)
        spoilt = measure_run(replace(run, frames=dirty(run.frames, np.random.default_rng(seed))), GEOMETRY)
        assert spoilt.front_rad == pytest.approx(0.4, abs=2e-3)
        assert spoilt.rear_rad == pytest.approx(-0.2, abs=2e-3)
        assert spoilt.speed_mps == pytest.approx(0.3, abs=5e-4)
        assert spoilt.quality.jumps > 5


@pytest.mark.parametrize("lag_s", [0.05, 0.3, 0.6])
def test_acceleration_and_stopping_are_left_out(lag_s):
    vehicle = Vehicle(lambda p: 0.3, lambda p: -0.05, lambda p: (1500 - p) / 2000, speed_lag_s=lag_s)
    commands = held(900, 1400, 1500, for_s=8)
    run = run_of(commands, vehicle.frames(commands, np.random.default_rng(1), until_s=10.0))
    measured = measure_run(run, GEOMETRY)
    assert measured.begin_s > 0.5 + 1.5 * lag_s
    assert measured.end_s <= 8.5
    assert measured.speed_mps == pytest.approx(0.3, rel=2e-3)
    assert measured.front_rad == pytest.approx(0.3, abs=1e-3)


def test_a_vehicle_that_stands_has_a_speed_and_no_angles():
    measured = measure_run(steady_run(0.3, 0.0, 0.0, drive=1480), GEOMETRY)
    assert not measured.moves
    assert abs(measured.speed_mps) < 4 * measured.speed_stderr_mps
    assert np.isnan(measured.front_rad)


def test_a_run_at_neutral_throughout_is_one_stretch():
    measured = measure_run(steady_run(0.3, 0.0, 0.0, drive=1500), GEOMETRY)
    assert measured.speed_mps == pytest.approx(0.0, abs=1e-4)
    assert measured.end_s == pytest.approx(6.5, abs=0.02)


def test_creeping_backward_is_negative():
    assert measure_run(steady_run(0.0, 0.0, -0.006), GEOMETRY).speed_mps == pytest.approx(-0.006, abs=2e-4)


def test_more_than_a_full_circle_and_a_few_frames_a_second():
    t = np.arange(0, 30, 1 / 10)
    poses = steady_poses(0.7, -0.4, 0.3, t)
    measured = measure_run(run_of(held(900, 1, 1, for_s=29.5, presteer_s=0.5), frames_of(t, poses)), GEOMETRY)
    assert measured.arc_rad > 4 * np.pi
    assert (measured.front_rad, measured.rear_rad) == pytest.approx((0.7, -0.4), abs=1e-6)


def test_runs_that_say_nothing_are_one_clear_line():
    run = steady_run(0.3, 0.0, 0.3)
    with pytest.raises(FitError, match=r"run r: too few frames to measure: 0 of 0 usable \(limit: at least 10\)"):
        measure_run(replace(run, frames=Frames.empty()), GEOMETRY)
    none = Commands(*[np.empty(0)] * 4)
    with pytest.raises(FitError, match="too few frames"):
        measure_run(replace(run, commands=none), GEOMETRY)
    with pytest.raises(FitError, match=r"too short a drive at one command to measure.*hold the command longer"):
        measure_run(replace(run, commands=held(900, 1400, 1500, for_s=0.6)), GEOMETRY)
    weaving = replace(run.frames, y_m=run.frames.y_m + 0.3 * np.sin(3 * run.frames.t_s))
    with pytest.raises(FitError, match="did not drive one arc"):
        measure_run(replace(run, frames=weaving), GEOMETRY)


def test_a_command_between_times_before_the_first_one_is_not_known():
    commands = Commands(np.array([0.0, 1.0]), np.array([1.0, 3.0]), np.zeros(2), np.zeros(2))
    from_s, to_s = np.array([-0.5, 0.0, 0.0, 0.5]), np.array([-0.1, -0.1, 0.5, 1.5])
    np.testing.assert_array_equal(command_spread(commands, "drive", from_s, to_s), [np.nan, np.nan, 0.0, 2.0])
