"""Steering, drive and clock that differ between recordings: the filter beside a regression, and recordings."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from differential_vehicle import HEADER, Campaign, Differential
from free_drives import FREE_HEADER, free_runs, joystick
from hypothesis import given
from hypothesis import strategies as st
from tiny_vehicle import NEUTRAL, Tiny

from agvbench.diagnosis import diagnose
from agvbench.diagnosis.data.readings import read_windows
from agvbench.diagnosis.data.windows import Horizon
from agvbench.diagnosis.free_driving.method import static_maps
from agvbench.diagnosis.free_driving.parameter_filter import filter_parameters
from agvbench.diagnosis.free_driving.varying_model import VaryingModel
from agvbench.diagnosis.free_driving.varying_parameters import _probability
from agvbench.diagnosis.free_driving.window_residuals import WindowResiduals
from agvbench.diagnosis.model.nodal_maps import NodalMaps
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.types import Command, Commands, Run
from agvbench.workflows.diagnosis_files import sessions_in_words

DRIFT_S, WITHIN_S = 50.0, 3.0


def filtered(begins_s, ends_s, residual, slopes, variance, *, slow, fast, restarts=None, ahead_s=0.0):
    count, m = len(begins_s), slopes.shape[2]
    estimates, density = np.empty((count, 2, m)), np.empty(count)
    first = np.arange(count) == 0 if restarts is None else restarts
    times_s = np.array([DRIFT_S, WITHIN_S])
    filter_parameters(
        first, begins_s, ends_s, residual, slopes, variance, slow, fast, times_s, ahead_s, estimates, density
    )
    return estimates, density


def drawn(seed, count=12, m=2, size=0.3):
    """Return windows of one second each, at irregular times, with small residuals: none of them is far off."""
    rng = np.random.default_rng(seed)
    begins_s = np.cumsum(rng.uniform(1.0, 4.0, count))
    variance = rng.uniform(0.5, 2.0, (count, 3))
    return begins_s, begins_s + 1.0, size * rng.normal(size=(count, 3)), rng.normal(size=(count, 3, m)), variance


def covariance(first_s, second_s, begun_s, slow, fast):
    """Return the prior covariance of a random walk and of an Ornstein–Uhlenbeck process at two times."""
    walked = slow * (1.0 + (min(first_s, second_s) - begun_s) / DRIFT_S)
    return walked + fast * np.exp(-abs(first_s - second_s) / WITHIN_S)


@given(st.integers(0, 10_000), st.sampled_from([[0.01, 0.03], [0.01], []]))
def test_estimates_are_those_of_a_regression_with_the_same_prior(seed, of_fast):
    begins_s, ends_s, residual, slopes, variance = drawn(seed)
    slow, fast = np.array([0.04, 0.02]), np.array(of_fast)
    estimates, _ = filtered(begins_s, ends_s, residual, slopes, variance, slow=slow, fast=fast)
    k, m = len(begins_s) - 1, 2
    times = [*begins_s[:k], begins_s[k]]
    prior = np.zeros((m * (k + 1), m * (k + 1)))
    for a, first in enumerate(times):
        for b, second in enumerate(times):
            for q in range(m):
                of_second = fast[q] if q < len(fast) else 0.0
                prior[m * a + q, m * b + q] = covariance(first, second, begins_s[0], slow[q], of_second)
    design = np.zeros((3 * k, m * (k + 1)))
    for a in range(k):
        design[3 * a : 3 * a + 3, m * a : m * a + m] = slopes[a]
    total = design @ prior @ design.T + np.diag(variance[:k].ravel())
    gain = prior @ design.T @ np.linalg.inv(total)
    mean, left = gain @ residual[:k].ravel(), prior - gain @ design @ prior
    # A residual of three standard deviations or less keeps its full weight.
    np.testing.assert_allclose(estimates[k, 0], mean[-m:], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(estimates[k, 1] ** 2, np.diagonal(left)[-m:], rtol=1e-9)


def test_the_part_within_a_recording_is_forgotten_ahead():
    begins_s, ends_s, residual, slopes, variance = drawn(1, m=1, size=1.0)
    none, fast = np.zeros(1), np.array([0.5])
    now, _ = filtered(begins_s, ends_s, residual, slopes, variance, slow=none, fast=fast)
    later, _ = filtered(begins_s, ends_s, residual, slopes, variance, slow=none, fast=fast, ahead_s=WITHIN_S)
    np.testing.assert_allclose(later[:, 0], now[:, 0] / np.e)


@given(st.integers(0, 10_000), st.integers(0, 11))
def test_a_window_says_nothing_before_it_has_ended(seed, changed):
    begins_s, ends_s, residual, slopes, variance = drawn(seed)
    ends_s = begins_s + 2.5  # some overlap the next one
    slow = fast = np.full(2, 0.04)
    before, _ = filtered(begins_s, ends_s, residual, slopes, variance, slow=slow, fast=fast)
    other = residual.copy()
    other[changed] += 1.0
    after, _ = filtered(begins_s, ends_s, other, slopes, variance, slow=slow, fast=fast)
    same = np.all(before[:, 0] == after[:, 0], axis=1)
    assert same[begins_s < ends_s[changed]].all()


def test_of_windows_that_overlap_one_counts():
    begins_s, ends_s, residual, slopes, variance = drawn(3)
    slow = fast = np.full(2, 0.04)
    alone, _ = filtered(begins_s, ends_s, residual, slopes, variance, slow=slow, fast=fast)
    twice = [np.repeat(values, 2, axis=0) for values in (begins_s, ends_s, residual, slopes, variance)]
    both, _ = filtered(*twice, slow=slow, fast=fast, restarts=np.arange(24) == 0)
    np.testing.assert_allclose(both[::2], alone)


def test_a_recording_begins_without_knowledge():
    begins_s, ends_s, residual, slopes, variance = drawn(4)
    slow, fast = np.array([0.04, 0.02]), np.array([0.01, 0.03])
    restarts = np.isin(np.arange(12), [0, 7])
    found, _ = filtered(begins_s, ends_s, residual, slopes, variance, slow=slow, fast=fast, restarts=restarts)
    np.testing.assert_array_equal(found[7], [[0.0, 0.0], np.sqrt(slow + fast)])


def test_a_window_without_an_end_is_passed_over():
    begins_s, ends_s, residual, slopes, variance = drawn(5)
    residual[4] = np.nan
    slow = fast = np.full(2, 0.04)
    found, density = filtered(begins_s, ends_s, residual, slopes, variance, slow=slow, fast=fast)
    assert np.isfinite(found).all()
    assert density[4] == 0.0
    kept = np.arange(12) != 4
    rest = (values[kept] for values in (begins_s, ends_s, residual, slopes, variance))
    without, _ = filtered(*rest, slow=slow, fast=fast)
    np.testing.assert_allclose(found[kept], without)


def test_a_residual_far_off_counts_little():
    begins_s, ends_s, residual, slopes, variance = drawn(6)
    slow = fast = np.full(2, 0.04)
    usual, _ = filtered(begins_s, ends_s, residual, slopes, variance, slow=slow, fast=fast)
    moved = []
    for size in (1e3, 1e6):
        wild = residual.copy()
        wild[5] = size
        moved.append(np.abs(filtered(begins_s, ends_s, wild, slopes, variance, slow=slow, fast=fast)[0] - usual).max())
    assert max(moved) < 0.1
    assert moved[1] == pytest.approx(moved[0], rel=0.05)


class Recordings:
    """Free driving of one vehicle, three recordings in the morning, and one in the evening, which is the test.

    In it the vehicle is steered beside what is recorded, by `steering_us`, and drives `faster`. If the drive is
    `held`, each recording has one drive command, which no other one has. In the morning the axles are steered by the
    share `reach` of what they are in the evening. The front axle has an end stop, `limit_us` from neutral. In the
    evening commands are given later than the logger says, by `later_s`, and the rigid body of the markers is defined
    with its heading turned by `body_rad`. The rear axle is steered unless it is `straight`.
    """

    header = FREE_HEADER

    def __init__(
        self,
        *,
        steering_us: float = 0.0,
        faster: float = 1.0,
        held: bool = False,
        reach: float = 1.0,
        limit_us: float = np.inf,
        later_s: float = 0.0,
        body_rad: float = 0.0,
        straight: bool = False,
    ) -> None:
        self._straight = straight
        self._held = itertools.cycle([1100.0, 1150.0, 1200.0, 1125.0] if held else [None])
        self._reach = itertools.cycle([reach, reach, reach, 1.0])
        recorded, driven = (
            free_runs(Tiny(steering_lag_s=0.15, speed_factor=factor), runs=1, seconds=60.0, by=partial(self._by, *by))
            for *by, factor in ((0.0, np.inf, 1.0), (steering_us, limit_us, faster))
        )
        splits = ("fit", "fit", "fit", "held_out")
        logged = recorded[3].commands
        frames = replace(driven[3].frames, heading_rad=driven[3].frames.heading_rad + body_rad)
        test = replace(driven[3], commands=replace(logged, t_s=logged.t_s - later_s), frames=frames)
        self.runs = [
            replace(run, session="evening" if k == 3 else "morning", split=splits[k], extra={"source": f"{k}.csv"})
            for k, run in enumerate([*recorded[:3], test])
        ]

    def _by(self, steering_us: float, limit_us: float, seconds: float, rng: np.random.Generator) -> Commands:
        commands, held = joystick(seconds, rng, next(self._reach)), next(self._held)
        drive = commands.drive if held is None else np.full_like(commands.drive, held)
        front = np.clip(commands.front + steering_us, NEUTRAL - limit_us, NEUTRAL + limit_us)
        rear = np.full_like(front, NEUTRAL) if self._straight else commands.rear
        return replace(commands, front=front, rear=rear, drive=drive)

    def __iter__(self) -> Iterator[Run]:
        return iter(self.runs)


def held_out(found):
    (row,) = [row for row in found.provenance["windows"]["recordings"] if row["held_out"]]
    return {
        name.removesuffix("_mm"): entry["rms"] for name, entry in row["ahead_2_s"].items() if isinstance(entry, dict)
    }


def at_end(found, name):
    entry = found.provenance["windows"]["varying"]["recordings"]["3.csv"][name]
    return entry["value"], entry["stderr"]


def test_a_steering_that_was_knocked_is_followed():
    found = diagnose(Recordings(steering_us=40.0))
    errors = held_out(found)
    assert errors["after"] < 0.6 * errors["population"]
    value, stderr = at_end(found, "front_offset_rad")
    assert abs(value) > 3.0 * stderr
    assert any("3.csv" in line and "front" in line for line in sessions_in_words({"provenance": found.provenance}))


def test_a_drive_that_runs_faster_at_a_command_of_its_own_is_followed():
    found = diagnose(Recordings(faster=1.1, held=True))
    assert not found.provenance["windows"]["sessions"]["evening"]["drive_level"]["significant"]
    errors = held_out(found)
    assert errors["after"] < 0.5 * errors["population"]
    value, stderr = at_end(found, "drive_gain")
    assert value > 3.0 * stderr
    assert value == pytest.approx(np.log(1.1), abs=0.04)


@pytest.mark.parametrize("later_s", [-0.03, 0.03])
def test_a_clock_that_is_less_off_than_a_session_must_be_is_followed(later_s):
    found = diagnose(Recordings(later_s=later_s))
    assert not found.provenance["windows"]["sessions"]["evening"]["clock_offset"]["significant"]
    errors = held_out(found)
    assert errors["after"] < 0.5 * errors["population"]
    value, stderr = at_end(found, "clock_offset_s")
    assert value == pytest.approx(later_s, abs=0.006)
    assert 0.0 < stderr < 0.01
    assert any("clock offset" in line for line in sessions_in_words({"provenance": found.provenance}))


def test_a_rigid_body_that_was_defined_anew_is_followed():
    found = diagnose(Recordings(body_rad=0.05, straight=True))
    errors = held_out(found)
    assert errors["after"] < 0.35 * errors["population"]
    value, stderr = at_end(found, "body_offset_rad")
    assert value == pytest.approx(0.05, abs=0.003)
    assert 0.0 < stderr < 0.003
    assert any("body offset 0.0" in line for line in sessions_in_words({"provenance": found.provenance}))


@given(st.floats(-0.3, 0.3), st.integers(0, 2))
def test_another_heading_of_the_rigid_body_turns_the_path_about_its_beginning(angle, seed):
    rng = np.random.default_rng(seed)
    start, poses = rng.normal(size=(4, 3)), rng.normal(size=(4, 8, 3))
    model = VaryingModel(cast(Predictor, SimpleNamespace(readings=SimpleNamespace(start=start))), np.empty(0), poses)
    turned = model._turned(poses, np.full(4, angle))
    before, after = ((of[..., :2] - start[:, None, :2]) @ [1.0, 1.0j] for of in (poses, turned))
    np.testing.assert_allclose(after, before * np.exp(-1.0j * angle), atol=1e-12)
    np.testing.assert_array_equal(turned[..., 2], poses[..., 2])


def test_a_map_beyond_the_training_commands_is_followed():
    found = diagnose(Recordings(reach=0.5, limit_us=200.0))
    errors = held_out(found)
    assert errors["after"] < 0.3 * errors["population"]
    assert found.provenance["windows"]["varying"]["map_components"] > 0


@given(st.integers(0, 10_000))
def test_components_of_the_maps_are_their_covariance(seed):
    rng = np.random.default_rng(seed)
    maps = NodalMaps(
        {"front": np.array([-1.0, 0.0, 1.0]), "rear": np.zeros(1), "drive": np.array([1.0, 2.0])},
        Command(0.0, 0.0, 0.0),
    )
    values, spread = rng.uniform(0.2, 1.0, maps.size), rng.normal(size=(maps.size, maps.size))
    predictor = cast(Predictor, SimpleNamespace(maps=maps))
    model = VaryingModel(predictor, values, spread @ spread.T)
    np.testing.assert_allclose(model.map_components.T @ model.map_components, spread @ spread.T, rtol=0.05, atol=0.05)
    assert not len(VaryingModel(predictor, values, 1e-8 * spread @ spread.T).map_components)


def test_a_fast_turn_of_a_differential_vehicle_is_predicted_as_fitted_where_nothing_varies():
    runs = list(Campaign(Differential(), sessions=1, seconds=20.0))
    neutral, geometry = HEADER.neutral, HEADER.geometry
    readings = read_windows(runs, Horizon(), neutral, turns_on_the_spot=True)
    fitted = static_maps(readings, runs, geometry, neutral)
    parameters = fitted.parameters.copy()
    parameters[fitted.predictor.maps.slices()["front"]] *= 4.0
    assert max(parameters[fitted.predictor.maps.slices()["front"]]) > 2.0  # rad/s, more than an axle angle may be
    nodal = fitted.predictor.maps.size
    model = VaryingModel(fitted.predictor, parameters, fitted.covariance[:nodal, :nodal])
    nothing = np.zeros((len(readings), len(model.quantities) + len(model.map_components)))
    np.testing.assert_array_equal(model.poses(nothing), model.as_fitted)


def test_the_curvature_of_a_differential_vehicle_varies_between_recordings_only():
    provenance = diagnose(Campaign(Differential(right_wheel=1.03))).provenance
    assert provenance["criteria"]["varying"]["offset_per_m"] > 0.0
    varying = provenance["windows"]["varying"]
    slow = {"front_offset_per_m", "clock_offset_s", "body_offset_rad"}
    assert {*varying["between_recordings"]} == {"front_gain", "drive_gain", *slow}
    assert {*varying["within_recordings"]} == {"front_gain", "drive_gain"}


def test_a_vehicle_that_stays_the_same_is_predicted_as_well():
    found = diagnose(Recordings())
    errors = held_out(found)
    assert errors["population"] < 1.5  # mm: 0.3 mm and 0.8 mrad of a frame are in it
    assert errors["after"] == pytest.approx(errors["population"], rel=0.2)
    assert [effect.name for effect in found.effects] == ["steering_lag"]
    for name in ("front_offset_rad", "front_gain", "drive_gain", "clock_offset_s", "body_offset_rad"):
        value, stderr = at_end(found, name)
        assert abs(value) < 3.0 * stderr
    assert not list(sessions_in_words({"provenance": found.provenance}))


def between(ends_s, begins_s, restarts):
    none = np.zeros((len(begins_s), 0))
    return WindowResiduals(np.arange(len(begins_s)), restarts, begins_s, ends_s, none, none, none, none)


def test_windows_that_ended_decide_whether_a_recording_varies():
    begins_s, restarts = np.arange(8.0), np.arange(8) == 0
    evidence = np.array([1.0, 2.0, -0.5, 0.0, 4.0, -9.0, -9.0, 3.0])
    found = _probability(between(begins_s + 1.0, begins_s, restarts), evidence)
    odds = np.concatenate([[0.0], np.cumsum(evidence)[:-1]])
    np.testing.assert_allclose(found, 1.0 / (1.0 + np.exp(-odds)))
    late = _probability(between(begins_s + 2.5, begins_s, restarts), evidence)
    np.testing.assert_allclose(late[3:], found[1:-2])
    np.testing.assert_array_equal(late[:3], 0.5)


def test_each_recording_decides_for_itself():
    begins_s, restarts = np.tile(np.arange(4.0), 2), np.arange(8) % 4 == 0
    found = _probability(between(begins_s + 1.0, begins_s, restarts), np.repeat([5.0, -5.0], 4))
    assert found[0] == found[4] == 0.5
    assert found[3] > 0.999
    assert found[7] < 0.001
