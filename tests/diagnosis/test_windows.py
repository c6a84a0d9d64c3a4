"""Windows of free driving: where they begin, what they may know, and what they are compared with."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from free_drives import FREE_HEADER, free_runs
from hypothesis import given
from hypothesis import strategies as st
from tiny_vehicle import HEADER, NEUTRAL, NEUTRAL_COMMAND, Tiny, campaign_runs

from agvbench.diagnosis.criteria import DATA
from agvbench.diagnosis.data import window_splits
from agvbench.diagnosis.data.readings import Readings, read_windows
from agvbench.diagnosis.data.window_splits import fitted_windows, held_out_windows, thinned
from agvbench.diagnosis.data.windows import Horizon, RecordedMotion, Window, cut_windows, horizon_of
from agvbench.diagnosis.free_driving.errors import WindowErrors, interval, repeatability_squares, squares
from agvbench.diagnosis.free_driving.maps import smooth_maps, start_values_of_windows
from agvbench.diagnosis.free_driving.predictors import constant_velocity
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.types import NO_TARGET, Commands, Frames, Run
from agvbench.vehicle.geometry import Geometry

HORIZON = Horizon(2.0, 1.0)
QUIET = Tiny(axle_scatter_rad=0.0, speed_scatter=0.0, noise_m=1e-6, noise_rad=1e-6)
GEOMETRY = Geometry(HEADER.front_axle_m, HEADER.rear_axle_m)


def arc(speed: float, yaw: float, noise_m: float = 0.0, seconds: float = 8.0, rate: float = 100.0) -> Run:
    """Return a run on a circle, from formulas."""
    t = np.arange(0.0, seconds, 1.0 / rate)
    heading = yaw * t
    x, y = speed * np.sin(heading) / yaw, speed * (1.0 - np.cos(heading)) / yaw
    rng = np.random.default_rng(0)
    x, y = (v + rng.normal(0.0, noise_m, len(t)) for v in (x, y))
    nan = np.full(len(t), np.nan)
    frames = Frames(t, x, y, heading, np.ones(len(t), dtype=bool), np.full(len(t), -1), nan, nan)
    one = np.array([0.0])
    return Run("arc", "free", "", "", 0, NO_TARGET, 0.0, "ok", "", Commands(one, one + 1000.0, one + 1400, one), frames)


def cut(run: Run) -> list[Window]:
    """Return the windows of a run that is a recording of its own."""
    return cut_windows(run, HORIZON, NEUTRAL_COMMAND, RecordedMotion.of([run]))


@pytest.fixture(scope="module")
def readings() -> Readings:
    return read_windows(free_runs(QUIET, sessions=3, runs=1), HORIZON, NEUTRAL_COMMAND)


@given(speed=st.floats(0.1, 2.0), yaw=st.floats(-2.0, 2.0).filter(lambda w: abs(w) > 0.01))
def test_the_state_on_a_circle_is_that_of_the_circle(speed, yaw):
    window = cut(arc(speed, yaw))[0]
    t = window.t0_s
    truth = [speed * math.sin(yaw * t) / yaw, speed * (1.0 - math.cos(yaw * t)) / yaw, yaw * t]
    np.testing.assert_allclose(window.start, truth, atol=2e-4 * (1.0 + speed * yaw * yaw))
    assert window.speed_mps == pytest.approx(speed, rel=0.02)
    assert window.recent_speed_mps == pytest.approx(speed, rel=0.01)
    assert window.yaw_rate[0] == pytest.approx(yaw, abs=0.02 * (1.0 + abs(yaw)))


def test_an_uncertain_yaw_rate_counts_less_beside_the_commands():
    weights = [cut(arc(0.8, 0.9, noise))[0].yaw_rate[1] for noise in (1e-5, 1e-3)]
    precise, noisy = (_with_heading_noise(arc(0.8, 0.9), deviation) for deviation in (1e-4, 0.05))
    assert min(weights) > 0.9  # noise of the position says nothing of the heading
    assert cut(precise)[0].yaw_rate[1] > 0.99 > 2.0 * cut(noisy)[0].yaw_rate[1] > 0.0


def _with_heading_noise(run: Run, deviation: float) -> Run:
    noise = np.random.default_rng(1).normal(0.0, deviation, len(run.frames))
    frames = dataclasses.replace(run.frames, heading_rad=run.frames.heading_rad + noise)
    return dataclasses.replace(run, frames=frames)


def test_the_naive_predictor_goes_on_along_the_circle():
    windows = cut(arc(0.8, 0.9))
    read = read_windows([arc(0.8, 0.9)], HORIZON, NEUTRAL_COMMAND)
    assert len(read) == len(windows) > 3
    np.testing.assert_allclose(constant_velocity(read), read.poses, atol=0.003)


def test_nothing_after_the_beginning_is_used():
    run = arc(0.5, 0.3, noise_m=1e-3)
    recorded = RecordedMotion.of([run])
    before = cut_windows(run, HORIZON, NEUTRAL_COMMAND, recorded)[0]
    later = run.frames.t_s > before.t0_s
    perturbed = dataclasses.replace(run.frames, x_m=run.frames.x_m + 0.01 * later * np.sin(40.0 * run.frames.t_s))
    again = cut_windows(dataclasses.replace(run, frames=perturbed), HORIZON, NEUTRAL_COMMAND, recorded)[0]
    for name in ("start", "speed_mps", "recent_speed_mps", "constant_velocity"):
        np.testing.assert_allclose(getattr(again, name), getattr(before, name), atol=1e-12)
    assert not np.allclose(again.poses, before.poses, atol=1e-3)


def test_a_tracker_that_jumps_metres_moves_no_window():
    run = arc(0.5, 0.3)
    wild = run.frames.x_m.copy()
    wild[[210, 211, 400]] += 9.0
    jumped = dataclasses.replace(run, frames=dataclasses.replace(run.frames, x_m=wild))
    calm, perturbed = cut(run), cut(jumped)
    assert len(perturbed) == len(calm) > 3
    for a, b in zip(calm, perturbed, strict=True):
        assert b.speed_mps == pytest.approx(a.speed_mps, abs=0.01)
        np.testing.assert_allclose(b.start, a.start, atol=1e-3)
        seen = np.isfinite(b.poses)
        np.testing.assert_allclose(b.poses[seen], a.poses[seen], atol=1e-3)
        assert seen.mean() > 0.9


def test_a_pose_that_the_tracker_repeats_while_the_vehicle_moves_is_no_measurement():
    run = arc(0.5, 0.3, rate=50.0)
    new = np.arange(len(run.frames)) // 4 * 4  # a pose every 0.08 s, in rows every 0.02 s
    repeated = {name: getattr(run.frames, name)[new] for name in ("x_m", "y_m", "heading_rad")}
    latched = cut(dataclasses.replace(run, frames=dataclasses.replace(run.frames, **repeated)))
    for window in latched:
        assert window.speed_mps == pytest.approx(0.5, rel=0.02)
        angle = 0.3 * window.t_s
        seen = np.isfinite(window.poses[:, 0])
        np.testing.assert_allclose(window.poses[seen, 0], (0.5 / 0.3 * np.sin(angle))[seen], atol=2e-3)
    assert len(latched) > 3


@pytest.mark.parametrize("rate", [5.0, 20.0, 1000.0])
def test_any_frame_rate_gives_windows_with_known_speed(rate):
    windows = cut(arc(0.5, 0.3, noise_m=5e-4, seconds=10.0, rate=rate))
    assert len(windows) >= 6
    for window in windows:
        assert abs(window.speed_mps - 0.5) < 4.0 * window.speed_stderr + 1e-3
        assert np.isfinite(window.poses).all()


def _without_commands(run: Run) -> Run:
    none = np.empty(0)
    return dataclasses.replace(run, commands=Commands(none, none, none, none))


def _at_rest(run: Run) -> Run:
    still = np.zeros(len(run.frames))
    return dataclasses.replace(run, frames=dataclasses.replace(run.frames, x_m=still, y_m=still, heading_rad=still))


@pytest.mark.parametrize(
    ("run", "reason"),
    [
        (_without_commands(arc(0.5, 0.3)), "has no commands"),
        (arc(0.5, 0.3, seconds=0.04), "has too few usable frames: 4 (limit: at least 6)"),
        (arc(0.5, 0.3, rate=2.0), "has too few frames per second: one every 0.5 s (limit: one every 0.25 s"),
        (arc(0.5, 0.3, seconds=1.8), "is too short: 1.79 s of frames (limit: at least 2.20 s)"),
        (_at_rest(arc(0.5, 0.3)), "has no window in motion: 0 m/s at most"),
    ],
)  # fmt: skip
def test_a_run_without_windows_says_why_with_figure_and_limit(run, reason):
    assert read_windows([run], HORIZON, NEUTRAL_COMMAND).refused["arc"].startswith(reason)


def test_no_window_begins_before_the_first_command():
    run = arc(0.5, 0.3)
    late = dataclasses.replace(run, commands=dataclasses.replace(run.commands, t_s=np.array([3.0])))
    windows = read_windows([late], HORIZON, NEUTRAL_COMMAND)
    assert windows.begins_s.min() >= 3.0
    start = start_values_of_windows(smooth_maps(windows.runs, NEUTRAL_COMMAND, 9, 6), windows, GEOMETRY)
    assert np.isfinite(start).all()


def test_a_direction_that_was_never_driven_mirrors_the_other(readings):
    maps = smooth_maps(readings.runs, NEUTRAL_COMMAND, 9, 6)
    assert (maps.nodes["drive"] < NEUTRAL).all()
    command = NEUTRAL + np.array([-300.0, -50.0, 0.0, 50.0, 300.0])
    speed = maps.weights("drive", command) @ np.arange(6.0, 0.0, -1.0)
    np.testing.assert_allclose(speed, -speed[::-1])
    assert speed[0] > 0.0


def test_nodes_span_the_commands_of_other_runs_in_driven_directions(readings):
    wide = dataclasses.replace(
        readings.runs[1],
        commands=Commands(
            np.arange(4.0), NEUTRAL + np.array([-650.0, 0.0, 200.0, 450.0]), np.array([700.0] * 4), np.zeros(4)
        ),
    )
    alone, both = (smooth_maps(readings.runs, NEUTRAL_COMMAND, 9, 6, others) for others in ([], [wide]))
    assert both.nodes["drive"].min() == NEUTRAL - 650.0 < alone.nodes["drive"].min()
    assert (both.nodes["drive"] < NEUTRAL).all()
    assert both.nodes["front"].min() == 700.0 < alone.nodes["front"].min()


def test_runs_from_rest_stay_runs_and_free_driving_becomes_windows():
    assert horizon_of(HEADER, campaign_runs(Tiny())[:6]) is None
    free = free_runs(QUIET, sessions=1, runs=2)
    assert horizon_of(HEADER, free) == Horizon()
    assert horizon_of(FREE_HEADER, free) == HORIZON


def test_slopes_by_nodes_are_those_of_whole_maps(readings):
    some = readings.select(np.arange(0, len(readings), 9))
    maps = smooth_maps(some.runs, NEUTRAL_COMMAND, 9, 6)
    batch = Batch(some, maps, GEOMETRY, 0.1)
    assert batch.perturbations.by_node
    predictor = Predictor(batch, ("steering_lag", "cornering_speed_loss"))
    values = np.r_[start_values_of_windows(maps, some, GEOMETRY), 0.1, 0.05]
    none = predictor.no_random_effects()
    slopes = predictor.linearise(values, none)
    rng = np.random.default_rng(3)
    way = rng.normal(size=len(values)) * 1e-4
    there, back = predictor.predict(values + way), predictor.predict(values - way)
    np.testing.assert_allclose((there - back) / 2.0, slopes.by_parameters @ way, atol=2e-6)
    way = rng.normal(size=none.shape) * 1e-4
    there, back = predictor.predict(values, way), predictor.predict(values, -way)
    expected = np.einsum("wkcj,wj->wkc", slopes.by_random_effects, way)
    np.testing.assert_allclose((there - back) / 2.0, expected, atol=2e-6)


@pytest.mark.parametrize("effects", [(), ("actuation_delay",), ("steering_lag", "speed_lag"), ("marker_offset",)])
def test_slopes_by_commands_that_no_longer_act_are_zero_and_not_simulated(readings, effects):
    some = readings.select(np.arange(0, len(readings), 5))
    maps = smooth_maps(some.runs, NEUTRAL_COMMAND, 40, 30)
    predictor, other = (Predictor(Batch(some, maps, GEOMETRY, 0.1), effects) for _ in range(2))
    perturbations = other.batch.perturbations
    assert perturbations.past.any()
    assert not perturbations.past.all()
    other.batch.perturbations = dataclasses.replace(perturbations, past=np.zeros_like(perturbations.past))
    values = np.r_[start_values_of_windows(maps, some, GEOMETRY), np.full(len(predictor.parameter_names), 0.1)]
    found, expected = (one.linearise(values, one.no_random_effects()) for one in (predictor, other))
    np.testing.assert_allclose(found.by_own, expected.by_own, rtol=0.0, atol=2e-4)
    assert np.count_nonzero(found.by_own) <= np.count_nonzero(expected.by_own)


def test_a_command_that_takes_effect_as_a_window_begins_does_not_determine_the_delay():
    read = read_windows(free_runs(QUIET, sessions=1, runs=1, by=_switched), HORIZON, NEUTRAL_COMMAND)
    maps = smooth_maps(read.runs, NEUTRAL_COMMAND, 9, 6)
    predictor = Predictor(Batch(read, maps, GEOMETRY), ("actuation_delay", "cornering_speed_loss", "speed_lag"))
    start, none = start_values_of_windows(maps, read, GEOMETRY), predictor.no_random_effects()
    simulated = zip(read.simulated(), read.begins_s, strict=True)
    delays_s = [np.min(begins_s - run.commands.t_s[run.commands.t_s < begins_s]) for run, begins_s in simulated]
    slopes = [
        predictor.linearise(np.r_[start, delay_s - 2e-5, 0.7, 0.7, 0.7], none).by_effects()["actuation_delay.delay_s"]
        for delay_s in delays_s
    ]
    assert np.abs(slopes)[..., :2].max() < 50.0  # m/s, in a difference over 0.05 ms about 2000


def _switched(seconds: float, rng: np.random.Generator) -> Commands:
    """Return a constant drive with a front axle that is switched between neutral and an end, at random times."""
    t_s = np.cumsum(rng.uniform(0.3, 1.0, round(2.0 * seconds)))
    t_s = np.r_[0.0, t_s[t_s < seconds]]
    ends = np.where(np.arange(len(t_s)) % 2, NEUTRAL + 350.0, NEUTRAL)
    return Commands(t_s, np.full_like(t_s, 1150.0), ends, np.full_like(t_s, NEUTRAL))


def test_commands_that_a_logger_repeats_are_simulated_once(readings):
    some = readings.select(np.arange(0, len(readings), 9))
    often = dataclasses.replace(some, runs=tuple(_repeated(run, 5) for run in some.runs))
    ours, theirs = (Batch(each, smooth_maps(some.runs, NEUTRAL_COMMAND, 9, 6), GEOMETRY) for each in (some, often))
    rows = sum(len(run.commands) for run in often.runs)
    assert len(theirs.base.drive) == len(ours.base.drive) < rows / 4
    values = np.r_[start_values_of_windows(ours.maps, some, GEOMETRY), 0.1, 0.05]
    poses = [Predictor(batch, ("steering_lag", "cornering_speed_loss")).predict(values) for batch in (ours, theirs)]
    np.testing.assert_array_equal(*poses)


def _repeated(run: Run, times: int) -> Run:
    """Return the run with every row of commands given several times, one after another."""
    c, share = run.commands, np.arange(times) / times
    t_s = c.t_s[:, None] + share * np.append(np.diff(c.t_s), 0.1)[:, None]
    repeated = Commands(t_s.ravel(), *(np.repeat(values, times) for values in (c.drive, c.front, c.rear)))
    return dataclasses.replace(run, commands=repeated)


def test_start_values_are_near_the_maps_that_drove(readings):
    from tiny_vehicle import front_of, speed_of

    maps = smooth_maps(readings.runs, NEUTRAL_COMMAND, 9, 6)
    start, where = start_values_of_windows(maps, readings, GEOMETRY), maps.slices()
    inner = slice(2, -2)
    fronts = [front_of(c) for c in maps.nodes["front"]]
    np.testing.assert_allclose(start[where["front"]][inner], fronts[inner], atol=0.08)
    speeds = [speed_of(c) for c in maps.nodes["drive"]]
    np.testing.assert_allclose(start[where["drive"]][inner], speeds[inner], atol=0.05)


def test_whole_sessions_are_set_aside(readings):
    held = held_out_windows(readings, 0)
    sessions = readings.initial_states.session
    assert 0 < np.count_nonzero(held) < 0.5 * len(held)
    assert not set(sessions[held]) & set(sessions[~held])
    assert len(set(sessions[~held])) >= 2


def test_the_split_of_the_campaign_decides(readings):
    runs = [dataclasses.replace(r, split="held_out" if r.session == "day 1" else "fit") for r in readings.runs]
    held = held_out_windows(dataclasses.replace(readings, runs=tuple(runs)), 0)
    assert set(readings.initial_states.session[held]) == {"day 1"}


@given(count=st.integers(1, 500), most=st.integers(2, 300))
def test_thinning_keeps_order_and_ends(count, most):
    kept = thinned(np.arange(count), most)
    assert len(kept) <= most
    assert (np.diff(kept) > 0).all()
    assert kept[0] == 0
    assert kept[-1] == count - 1


def test_windows_full_of_commands_are_fitted_in_smaller_number(readings, monkeypatch):
    inside = sum(
        np.count_nonzero(run.commands.t_s > begins_s)
        for run, begins_s in zip(readings.simulated(), readings.begins_s, strict=True)
    )

    def fitted(**limits: int) -> Readings:
        monkeypatch.setattr(window_splits, "DATA", dataclasses.replace(DATA, **limits))
        return fitted_windows(readings)

    assert len(fitted(max_fitted_commands=inside)) == len(readings)
    half = fitted(max_fitted_commands=inside // 2, min_fitted_windows=1)
    assert len(half) == pytest.approx(len(readings) / 2, abs=1.0)
    assert (half.runs[0], half.runs[-1]) == (readings.runs[0], readings.runs[-1])
    assert len(fitted(max_fitted_commands=1, min_fitted_windows=20)) == 20


def test_errors_are_told_by_recording_with_intervals_over_stretches(readings):
    none = np.zeros(len(readings), dtype=bool)
    predicted = {"naive": constant_velocity(readings)}
    table = WindowErrors(readings, predicted, np.zeros_like(readings.poses), 0).by_recording(none, none)
    counts = [np.count_nonzero(readings.initial_states.recording == f"{k}-0") for k in range(3)]
    assert [row["windows"] for row in table] == counts
    error = np.sqrt(np.nanmean(squares(readings, constant_velocity(readings))["position_rms_mm"][: counts[0]])) * 1e3
    assert table[0]["ahead_2_s"]["naive_mm"]["rms"] == pytest.approx(error)
    assert table[0]["ahead_1_s"]["naive_mm"]["rms"] < error


def test_an_interval_covers_its_error_and_is_unknown_without_stretches():
    values = np.random.default_rng(0).exponential(1.0, 64)
    alone, together = np.arange(64), np.arange(64) // 16
    covers = 0
    for seed in range(200):
        drawn = interval(np.random.default_rng(seed).exponential(1.0, 64), np.arange(64), seed)
        covers += drawn["low"] <= 1e3 <= drawn["high"]
    assert 0.85 <= covers / 200 <= 0.99  # percentiles of a skew mean fall a little short of 95 %
    many, few = interval(values, alone, 0), interval(np.sort(values), together, 0)
    assert many["low"] < many["rms"] < many["high"]
    assert few["high"] - few["low"] > many["high"] - many["low"]
    assert np.isnan(interval(values, np.arange(64) // 32, 0)["low"])


def test_there_is_a_floor_where_a_perfect_predictor_misses_nothing(readings):
    exact = readings.poses.copy()
    assert np.nanmax(squares(readings, exact)["position_rms_mm"]) == 0.0
    assert (repeatability_squares(readings, np.zeros_like(exact))["position_rms_mm"] > 0.0).all()
