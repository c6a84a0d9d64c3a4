"""Rollouts against DOP853 on equations written out in the test, against closed forms, and against invariants."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from rollout_truth import Truth

from agvbench.effects import ActuationDelay, SpeedLag, SteeringLag, effect_kinds
from agvbench.errors import InputError, VehicleError
from agvbench.model import VehicleModel, example_vehicle, thesis_vehicle
from agvbench.types import Commands, Floats, Pose
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Driven, Geometry
from agvbench.vehicle.maps import Line

UNIT = Line(1.0, 0.0)


def vehicle(truth: Truth) -> VehicleModel:
    """A vehicle whose commands are its angles [rad] and speed [m/s]."""
    return VehicleModel(
        name="unit",
        geometry=Geometry(truth.lf, truth.lr),
        channels=Channels.alike("normalised"),
        front=UNIT,
        rear=UNIT,
        drive=UNIT,
        effects=(
            ActuationDelay(truth.delay),
            SteeringLag(truth.steering_lag),
            SpeedLag(truth.accelerate, truth.brake),
        ),
    )


def commands(t_s: Floats, settled: Floats) -> Commands:
    return Commands(t_s, settled[:, 2], settled[:, 0], settled[:, 1])


lag = st.sampled_from((0.0, 0.02)) | st.floats(0.01, 1.5)
truths = st.builds(
    Truth, lf=st.floats(0.05, 1.5), lr=st.floats(0.05, 1.5), delay=st.floats(0.0, 0.3), steering_lag=lag,
    accelerate=lag, brake=lag,
)  # fmt: skip


@settings(max_examples=40, deadline=None)
# A drive that reverses: near rest the yaw rate is small and bounds no step.
@example(truth=Truth(0.5, 0.5, 0.0, 0.0, 0.0, 0.02), seed=0, scale=3.0, count=4)
@example(truth=Truth(0.25, 0.25, 0.0, 0.0, 1.0, 0.0), seed=0, scale=3.0, count=4)
@given(
    truth=truths,
    seed=st.integers(0, 2**32 - 1),
    scale=st.sampled_from((0.3, 3.0)),
    count=st.integers(1, 12),
)
def test_rollout_agrees_with_dop853_to_micrometres(truth: Truth, seed: int, scale: float, count: int) -> None:
    rng = np.random.default_rng(seed)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.03, 1.0, count - 1))])
    settled = rng.uniform(-1.0, 1.0, (count, 3)) * [0.7, 0.7, scale]
    settled[rng.random(count) < 0.15, 2] = 0.0
    start = rng.uniform(-3.0, 3.0, 3)
    t = np.sort(rng.uniform(-0.2, times[-1] + 2.0, 150))
    ours = vehicle(truth).rollout([commands(times, settled)], [start], [t])[0]
    np.testing.assert_allclose(ours, truth.poses(times, settled, start, (0.0, 0.0), t), rtol=0.0, atol=4e-5 * scale)


def test_a_vehicle_with_every_lag_at_camera_rate_stays_within_five_micrometres() -> None:
    truth = Truth(0.181, 0.121, 0.05, 0.12, 0.25, 0.4)
    rng = np.random.default_rng(5)
    times, t = np.arange(0.0, 10.0, 0.5), np.arange(2401) / 240.0
    settled = rng.uniform(-1.0, 1.0, (20, 3)) * [0.7, 0.7, 0.32]
    ours = vehicle(truth).rollout([commands(times, settled)], [(0.0, 0.0, 0.0)], [t])[0]
    reference = truth.poses(times, settled, np.zeros(3), (0.0, 0.0), t)
    assert np.abs(ours - reference).max() < 5e-6


@pytest.mark.parametrize(("front", "rear"), [(0.3, 0.3), (0.3, 0.0), (0.0, 0.3), (0.4, -0.4), (0.0, 0.0), (-0.5, 0.2)])
@pytest.mark.parametrize("speed", [0.3, -0.3])
def test_settled_commands_give_exact_arcs(front: float, rear: float, speed: float) -> None:
    truth = Truth(0.181, 0.121, 0.0, 0.0, 0.0, 0.0)
    t = np.linspace(0.0, 60.0, 400)
    got = vehicle(truth).rollout([commands(np.zeros(1), np.array([[front, rear, speed]]))], [(1.0, -2.0, 0.7)], [t])[0]
    forward = speed * (math.cos(front) + math.cos(rear)) / 2.0
    left = forward * (0.181 * math.tan(rear) + 0.121 * math.tan(front)) / 0.302
    yaw = forward * (math.tan(front) - math.tan(rear)) / 0.302
    heading = 0.7 + yaw * t
    velocity = complex(forward, left)
    turned = (np.exp(1j * heading) - np.exp(0.7j)) / (1j * yaw) if yaw else t * np.exp(0.7j)
    position = complex(1.0, -2.0) + velocity * turned
    np.testing.assert_allclose(got, np.column_stack([position.real, position.imag, heading]), rtol=0.0, atol=2e-7)


@pytest.mark.parametrize(("driven", "axle_m"), [("front", 0.181), ("rear", -0.121)])
@pytest.mark.parametrize("speed", [0.3, -0.3])
def test_the_driven_axle_covers_the_distance_of_the_drive(driven: Driven, axle_m: float, speed: float) -> None:
    model = replace(vehicle(Truth(0.181, 0.121, 0.0, 0.0, 0.0, 0.0)), geometry=Geometry(0.181, 0.121, driven))
    t = np.linspace(0.0, 10.0, 4001)
    x, y, heading = model.rollout([commands(np.zeros(1), np.array([[0.4, -0.2, speed]]))], [(0.0, 0.0, 0.0)], [t])[0].T
    axle = np.column_stack([x + axle_m * np.cos(heading), y + axle_m * np.sin(heading)])
    assert np.hypot(*np.diff(axle, axis=0).T).sum() == pytest.approx(3.0, abs=1e-4)


def test_straight_line_with_speed_lag_has_its_closed_form() -> None:
    truth = Truth(0.2, 0.1, 0.1, 0.0, 0.3, 0.6)
    t = np.linspace(0.0, 12.0, 200)
    settled = np.array([[0.0, 0.0, 0.3], [0.0, 0.0, 0.0]])
    got = vehicle(truth).rollout([commands(np.array([0.0, 4.0]), settled)], [(0.0, 0.0, 0.0)], [t])[0]
    since = np.clip(t - 0.1, 0.0, 4.0)
    driven = 0.3 * (since - 0.3 * (1.0 - np.exp(-since / 0.3)))
    top = 0.3 * (1.0 - math.exp(-4.0 / 0.3))
    rolled = top * 0.6 * (1.0 - np.exp(-np.clip(t - 4.1, 0.0, None) / 0.6))
    np.testing.assert_allclose(got[:, 0], driven + rolled, rtol=0.0, atol=1e-6)
    assert np.all(got[:, 1:] == 0.0)


def random_batch(seed: int, runs: int) -> tuple[list[Commands], Floats, list[Floats]]:
    rng = np.random.default_rng(seed)
    given = [
        Commands(np.arange(n) * 0.4, *(rng.uniform(950.0, 2050.0, n) for _ in range(3)))
        for n in rng.integers(1, 15, runs)
    ]
    times = [np.sort(rng.uniform(-0.5, 6.0, n)) for n in rng.integers(0, 200, runs)]
    return given, rng.uniform(-2.0, 2.0, (runs, 3)), times


LAGGED = thesis_vehicle().with_effects(ActuationDelay(0.06), SteeringLag(0.15), SpeedLag(0.3, 0.5))


def test_a_batch_is_its_runs_one_by_one() -> None:
    given, initial, times = random_batch(1, 20)
    together = LAGGED.rollout(given, initial, times)
    for i, poses in enumerate(together):
        assert poses.shape == (len(times[i]), 3)
        assert np.array_equal(poses, LAGGED.rollout([given[i]], initial[i : i + 1], [times[i]])[0])


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), x=st.floats(-5, 5), y=st.floats(-5, 5), heading=st.floats(-7, 7))
def test_moving_the_start_moves_the_run(seed: int, x: float, y: float, heading: float) -> None:
    given, _, times = random_batch(seed, 1)
    times = [np.append(times[0], 6.5)]
    start = Pose(x, y, heading)
    moved = LAGGED.rollout(given, [start], times)[0]
    at_origin = LAGGED.rollout(given, np.zeros((1, 3)), times)[0]
    end, back = Pose(*moved[-1]).relative_to(start), Pose(*at_origin[-1])
    assert math.hypot(end.x_m - back.x_m, end.y_m - back.y_m) < 1e-9
    assert math.sin(end.heading_rad - back.heading_rad) == pytest.approx(0.0, abs=1e-9)


def test_mirrored_steering_mirrors_the_path() -> None:
    model = vehicle(Truth(0.2, 0.1, 0.05, 0.1, 0.2, 0.3))
    settled = np.array([[0.4, -0.2, 0.3], [-0.1, 0.3, -0.2], [0.5, 0.0, 0.4]])
    mirrored = settled * [-1.0, -1.0, 1.0]
    times, t = np.array([0.0, 1.0, 2.0]), np.linspace(0.0, 4.0, 50)
    a, b = model.rollout([commands(times, s) for s in (settled, mirrored)], np.zeros((2, 3)), [t, t])
    np.testing.assert_allclose(a, b * [1.0, -1.0, -1.0], rtol=0.0, atol=1e-14)


def test_splitting_a_command_in_two_changes_nothing() -> None:
    once = Commands(*(np.array([v]) for v in (0.0, 1200.0, 1300.0, 1600.0)))
    twice = Commands(
        *(np.array([v, w]) for v, w in ((0.0, 0.37), (1200.0, 1200.0), (1300.0, 1300.0), (1600.0, 1600.0)))
    )
    t = np.linspace(0.0, 3.0, 60)
    a, b = LAGGED.rollout([once, twice], np.zeros((2, 3)), [t, t])
    np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-6)


def test_before_the_first_command_arrives_the_vehicle_stands_with_its_axles_at_neutral() -> None:
    given = Commands(*(np.array([v]) for v in (0.0, 1000.0, 1200.0, 1500.0)))
    poses = LAGGED.rollout([given], [(1.0, 2.0, 3.0)], [[-1.0, 0.0, 0.06, 0.2]])[0]
    assert poses[:3].tolist() == [[1.0, 2.0, 3.0]] * 3
    assert poses[3, 0] != 1.0
    # With the axles at neutral the thesis' vehicle starts slightly to the right; they turn left only gradually.
    slow = LAGGED.with_effects(SteeringLag(5.0)).rollout([given], [(0.0, 0.0, 0.0)], [[0.3]])[0]
    assert slow[0, 1] < 0.0


def test_front_steered_vehicle_keeps_its_rear_axle_on_the_path_of_a_tricycle() -> None:
    model = example_vehicle("front_steered")
    given = Commands(np.array([0.0, 1.0]), np.array([0.5, 0.7]), np.array([0.6, -0.8]), np.zeros(2))
    t = np.linspace(0.0, 3.0, 3001)
    x, y, heading = model.rollout([given], np.zeros((1, 3)), [t])[0].T
    rear_x, rear_y = x - 0.115 * np.cos(heading), y - 0.115 * np.sin(heading)
    sideways = -np.sin(heading[:-1]) * np.diff(rear_x) + np.cos(heading[:-1]) * np.diff(rear_y)
    assert np.abs(sideways).max() < 1e-5
    assert np.hypot(np.diff(rear_x), np.diff(rear_y)).sum() > 2.0


def test_no_runs_no_times_and_lists_are_fine() -> None:
    assert LAGGED.rollout([], np.empty((0, 3)), []) == []
    given = Commands(*(np.array([v]) for v in (0.0, 1000.0, 1200.0, 1500.0)))
    assert LAGGED.rollout([given], [[0, 0, 0]], [[]])[0].shape == (0, 3)


def _broken(**changes: object) -> Commands:
    good = Commands(*(np.array([v, v + 1.0]) for v in (0.0, 1000.0, 1200.0, 1500.0)))
    return replace(good, **{key: np.asarray(value) for key, value in changes.items()})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("given", "initial", "times", "message"),
    [
        ([], [(0, 0, 0)], [], "equally many: 0, 1 and 0"),
        ([_broken()], [0, 0, 0], [[1.0]], r"must have shape \(runs, 3\): \(3,\)"),
        ([_broken()], [(0, 0, math.nan)], [[1.0]], "run 0: initial pose is not finite"),
        ([_broken(), _broken(t_s=[1.0, 0.0])], np.zeros((2, 3)), [[1.0]] * 2, r"run 1: commands\.t_s\[1\]: time goes"),
        (
            [_broken(t_s=[1.0, 0.5])],
            [(0, 0, 0)],
            [[1.0]],
            r"run 0: commands\.t_s\[1\]: time goes back: 0\.5 s after 1 s",
        ),
        ([_broken(drive=[1500.0, math.nan])], [(0, 0, 0)], [[1.0]], r"run 0: commands\.drive\[1\]: is not finite: nan"),
        ([_broken(front=[1500.0])], [(0, 0, 0)], [[1.0]], r"run 0: commands\.front: has another length than t_s: 1"),
        ([_broken()], [(0, 0, 0)], [[0.0, 2.0, 1.0]], r"run 0: t_s\[2\]: time goes back: 1 s after 2 s.*sort by time"),
        ([_broken()], [(0, 0, 0)], [[0.0, math.inf]], r"run 0: t_s\[1\]: is not finite: inf"),
        ([_broken()], [(0, 0, 0)], [[[0.0]]], r"run 0: t_s: must have one dimension: \(1, 1\)"),
        ([Commands(*[np.empty(0)] * 4)], [(0, 0, 0)], [[0.0]], "run 0: a run needs a command"),
    ],
)
def test_input_that_is_no_batch_is_refused(given: object, initial: object, times: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        LAGGED.rollout(given, initial, times)  # type: ignore[arg-type]


def test_an_unbounded_map_that_turns_too_far_is_refused() -> None:
    with pytest.raises(VehicleError, match=r"front axle angle is too large: 114\.6° at command 2 \(limit: ±89°\)"):
        vehicle(Truth(0.2, 0.1, 0.0, 0.0, 0.0, 0.0)).rollout(
            [commands(np.zeros(1), np.array([[2.0, 0.0, 0.1]]))], np.zeros((1, 3)), [[1.0]]
        )


def test_absurd_numbers_do_not_hang() -> None:
    model = vehicle(Truth(0.2, 0.1, 0.0, 1e-5, 1e-5, 1e-5))
    settled = np.array([[1.5, -1.5, 50.0], [-1.5, 1.5, -50.0]])
    poses = model.rollout([commands(np.array([0.0, 0.05]), settled)], np.zeros((1, 3)), [np.linspace(0.0, 0.1, 5)])[0]
    assert np.all(np.isfinite(poses))


def test_a_battery_goes_on_drooping_between_runs() -> None:
    model = thesis_vehicle().with_effects(effect_kinds()["battery_droop"](per_hour=0.2))
    given = Commands(*(np.array([v]) for v in (0.0, 1800.0, 1800.0, 1200.0)))
    fresh, drained = (model.rollout([given], [(0.0, 0.0, 0.0)], [[4.0]], [h])[0] for h in (0.0, 1.0))
    assert math.hypot(*(drained - fresh)[0, :2]) > 0.05
