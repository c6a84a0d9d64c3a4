"""Differential vehicles: rollouts against DOP853 on equations written out here, files, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from agvbench.campaign import CampaignHeader
from agvbench.effects import (
    ActuationDelay,
    BatteryDroop,
    CorneringSpeedLoss,
    Effect,
    MocapLatency,
    SpeedLag,
    SteeringLag,
    WheelDiameterMismatch,
)
from agvbench.effects.ground.turning_resistance import TurningResistance, likely_integral
from agvbench.effects.variants import effect_variants
from agvbench.errors import CampaignError, VehicleError
from agvbench.model import VehicleModel
from agvbench.types import Commands, Floats
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.kinematics import actuator_values
from agvbench.vehicle.maps import Fixed, Line

GEOMETRY = Geometry(0.0, 0.15, kinematics="differential")


def turtle(lag_s: float = 0.0, speed_lag_s: float = 0.0, curvature: float = 0.0) -> VehicleModel:
    """A vehicle whose commands are its speed [m/s] and yaw rate [rad/s]."""
    return VehicleModel(
        name="turtle", geometry=GEOMETRY, channels=Channels.alike("si"),
        front=Line(1.0, 0.0), rear=Fixed(command=0.0), drive=Line(1.0, 0.0),
        effects=(SteeringLag(lag_s), SpeedLag(speed_lag_s, speed_lag_s), WheelDiameterMismatch(curvature)),
    )  # fmt: skip


def truth(t_s: Floats, times: Floats, commanded: Floats, lag_s: float, speed_lag_s: float, curvature: float) -> Floats:
    """Return poses (n, 3) of the centroid, which is 0.15 m ahead of the axle; `commanded` (m, 2): speed, yaw rate."""

    def rate(_: float, s: Floats, v_aim: float, w_aim: float) -> list[float]:
        v, w = s[3] if speed_lag_s else v_aim, s[4] if lag_s else w_aim
        yaw = w + curvature * v
        dv = (v_aim - s[3]) / speed_lag_s if speed_lag_s else 0.0
        dw = (w_aim - s[4]) / lag_s if lag_s else 0.0
        return [v * np.cos(s[2]), v * np.sin(s[2]), yaw, dv, dw]

    state, out = np.array([-0.15, 0.0, 0.0, 0.0, 0.0]), np.empty((len(t_s), 3))
    ends = np.append(times[1:], t_s[-1] + 1.0)
    for begin, end, (v_aim, w_aim) in zip(times, ends, commanded, strict=True):
        own = (t_s >= begin) & (t_s < end)
        solved = solve_ivp(
            rate, (begin, end), state, "DOP853", t_eval=np.append(t_s[own], end), args=(v_aim, w_aim), rtol=1e-10,
            atol=1e-12,
        )  # fmt: skip
        out[own], state = solved.y[:3, :-1].T, solved.y[:, -1]
    return np.column_stack([out[:, 0] + 0.15 * np.cos(out[:, 2]), out[:, 1] + 0.15 * np.sin(out[:, 2]), out[:, 2]])


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    lag_s=st.sampled_from((0.0, 0.1, 0.8)),
    speed_lag_s=st.sampled_from((0.0, 0.2, 1.0)),
    curvature=st.sampled_from((0.0, 0.1)),
)
def test_rollouts_agree_with_dop853(seed: int, lag_s: float, speed_lag_s: float, curvature: float) -> None:
    rng = np.random.default_rng(seed)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.05, 1.0, 6))])
    commanded = rng.uniform(-1.0, 1.0, (7, 2)) * [0.8, 1.5]
    commanded[rng.random(7) < 0.3, 0] = 0.0  # turns on the spot
    t = np.linspace(0.0, times[-1] + 1.0, 120)
    commands = Commands(times, commanded[:, 0], commanded[:, 1], np.zeros(7))
    ours = turtle(lag_s, speed_lag_s, curvature).rollout([commands], [(0.0, 0.0, 0.0)], [t])[0]
    expected = truth(t, times, commanded, lag_s, speed_lag_s, curvature)
    np.testing.assert_allclose(ours, expected, rtol=0.0, atol=5e-5)


@pytest.mark.parametrize(("lag_s", "inertia_s"), [(0.11, 0.07), (0.05, 0.1), (0.4, 0.05), (0.1, 0.05)])
def test_wheels_of_second_order_agree_with_dop853(lag_s: float, inertia_s: float) -> None:
    times = np.array([0.0, 0.7, 1.0, 1.15, 2.0, 2.8])
    commanded = np.array([[0.4, 0.3], [0.4, -1.0], [-0.3, 0.8], [0.2, 0.0], [0.0, 1.2], [0.0, 0.0]])
    t = np.linspace(0.0, 5.0, 150)

    def rate(_: float, s: Floats, left: float, right: float) -> list[float]:
        forward, yaw = 0.5 * (s[3] + s[5]), (s[5] - s[3]) / 0.4
        wheels = [(aim - w - lag_s * a) / inertia_s**2 for aim, w, a in ((left, s[3], s[4]), (right, s[5], s[6]))]
        return [forward * np.cos(s[2]), forward * np.sin(s[2]), yaw, s[4], wheels[0], s[6], wheels[1]]

    state, out = np.array([-0.15, *[0.0] * 6]), np.empty((len(t), 3))
    for begin, end, (v, w) in zip(times, [*times[1:], 6.0], commanded, strict=True):
        own = (t >= begin) & (t < end)
        at = np.append(t[own], end)
        wheels = (v - 0.2 * w, v + 0.2 * w)
        solved = solve_ivp(rate, (begin, end), state, "DOP853", t_eval=at, args=wheels, rtol=1e-10, atol=1e-12)
        out[own], state = solved.y[:3, :-1].T, solved.y[:, -1]
    expected = np.column_stack([out[:, 0] + 0.15 * np.cos(out[:, 2]), out[:, 1] + 0.15 * np.sin(out[:, 2]), out[:, 2]])
    robot = turtle().with_effects(effect_variants()["wheel_lag_inertia"](lag_s, inertia_s))
    zeros = np.zeros(len(times))
    ours = robot.rollout([Commands(times, *commanded.T, zeros)], [(0.0, 0.0, 0.0)], [t])[0]
    np.testing.assert_allclose(ours, expected, rtol=0.0, atol=5e-6)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    friction=st.sampled_from((0.0, 0.15, 0.6, 3.0)),
    integral_time_s=st.sampled_from((0.3, 2.0, 20.0)),
)
def test_a_turning_resistance_agrees_with_a_controller_in_small_steps(
    seed: int, friction: float, integral_time_s: float
) -> None:
    rng, step_s = np.random.default_rng(seed), 5e-4
    times = np.append(0.0, np.cumsum(rng.integers(100, 4000, 6) * step_s))
    yaw_rates = rng.choice([-0.9, -0.3, 0.0, 0.3, 0.9], 7)
    at = np.arange(0.0, times[-1] + 3.0, step_s)
    integral, turned = 0.0, np.zeros(len(at) + 1)
    for k, target in enumerate(yaw_rates[np.searchsorted(times, at + 1e-9) - 1]):
        torque = target + integral
        yaw_rate = torque - min(max(torque, -friction), friction)
        integral += (target - yaw_rate) * step_s / integral_time_s
        turned[k + 1] = turned[k] + yaw_rate * step_s
    robot = turtle().with_effects(TurningResistance(friction, integral_time_s))
    aims = Commands(times, np.zeros(7), yaw_rates, np.zeros(7))
    heading = robot.rollout([aims], [(0.0, 0.0, 0.0)], [at[::100]])[0][:, 2]
    np.testing.assert_allclose(heading, turned[:-1][::100], rtol=0.0, atol=3e-3)


@given(
    yaw_rate=st.floats(0.01, 2.0),
    target=st.floats(-2.0, 2.0),
    friction=st.floats(0.01, 2.0),
    known=st.floats(-1.0, 1.0),
)
def test_a_measured_yaw_rate_tells_the_integral_part(
    yaw_rate: float, target: float, friction: float, known: float
) -> None:
    """A vehicle that certainly turns has overcome the friction; a measurement without weight changes nothing."""
    integral = known * friction
    certain = likely_integral(integral, target, yaw_rate, 1.0 - 1e-9, friction)
    assert abs(certain) <= friction
    if abs(yaw_rate + friction - target) <= friction:
        assert target + certain - friction == pytest.approx(yaw_rate, abs=1e-3)
    assert likely_integral(integral, target, yaw_rate, 0.0, friction) == pytest.approx(integral, abs=1e-12)


def test_a_battery_of_both_wheels_slows_turns_as_the_library_s_does_not() -> None:
    times, commanded = np.array([0.0, 3.0]), np.array([[0.0, 0.8], [0.3, 0.0]])
    t, aims = np.linspace(0.0, 6.0, 61)[:-1], Commands(times, *commanded.T, np.zeros(2))
    wheels, controller = effect_variants()["battery_droop_wheels"](0.2), BatteryDroop(0.2)
    found = {
        e.name: turtle().with_effects(e).rollout([aims], [(0.0, 0.0, 0.0)], [t], [1.5])[0] for e in (wheels, controller)
    }
    # The battery falls by 0.03 % within these seconds.
    for name, turns in (("battery_droop_wheels", 0.7), ("battery_droop", 1.0)):
        expected = truth(t, times, commanded * [0.7, turns], 0.0, 0.0, 0.0)
        np.testing.assert_allclose(found[name], expected, rtol=0.0, atol=1e-3)


@settings(max_examples=20, deadline=None)
@given(delay_s=st.floats(0.0, 0.3), late_s=st.floats(0.0, 0.3))
def test_a_delay_and_a_latency_of_the_camera_shift_every_run_from_rest_alike(delay_s: float, late_s: float) -> None:
    """No campaign of such runs tells them apart: only their sum is in it."""
    times, commanded = np.array([0.0, 1.0, 2.2]), np.array([[0.3, 0.4], [-0.2, 0.9], [0.0, 0.0]])
    t, aims = np.linspace(0.0, 4.0, 81), Commands(times, *commanded.T, np.zeros(3))
    robot = turtle(0.1, 0.2, 0.05)

    def seen(*effects: Effect) -> Floats:
        return robot.with_effects(*effects).rollout([aims], [(0.0, 0.0, 0.0)], [t])[0]

    both = seen(ActuationDelay(delay_s), MocapLatency(late_s))
    np.testing.assert_allclose(both, seen(ActuationDelay(delay_s + late_s)), rtol=0.0, atol=1e-7)


@given(forward=st.floats(-2.0, 2.0), yaw=st.floats(-5.0, 5.0))
def test_the_actuators_have_speed_and_yaw_rate(forward: float, yaw: float) -> None:
    assert [float(v) for v in actuator_values(forward, 0.15 * yaw, yaw, GEOMETRY)] == [yaw, 0.0, forward]


def test_a_vehicle_file_keeps_its_kinematics(tmp_path) -> None:
    path = tmp_path / "vehicle.toml"
    turtle(0.1).save(path)
    assert VehicleModel.load(path) == turtle(0.1)
    assert 'unit = "rad/s"' in path.read_text(encoding="utf-8")
    path.write_text(path.read_text(encoding="utf-8").replace("rad/s", "rad"), encoding="utf-8")
    with pytest.raises(VehicleError, match=r"maps\.front\.unit: wrong unit: 'rad' \(limit: rad/s\)"):
        VehicleModel.load(path)


def test_an_effect_of_steered_axles_is_refused() -> None:
    with pytest.raises(
        VehicleError, match="an effect of steered axles, but the vehicle has none: cornering_speed_loss"
    ):
        turtle().with_effects(CorneringSpeedLoss(0.1))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((0.1, 0.1, "both", "differential"), "a differential vehicle has no front axle: 0.1 m"),
        ((0.1, 0.1, "both", "hover"), "unknown kinematics: 'hover' .one of: two_axle, differential"),
        ((0.0, -21.0, "both", "differential"), "rear_axle_m is longer than any vehicle"),
        ((0.1, -0.1, "both", "two_axle"), "rear_axle_m: must be greater than zero"),
    ],
)
def test_a_geometry_that_cannot_be_is_refused(values, message) -> None:
    with pytest.raises(VehicleError, match=message):
        Geometry(*values)


HEADER = CampaignHeader(3, "c", "turtle", 0.0, -0.05, Channels.alike("si"), 50.0, kinematics="differential")


def test_a_campaign_keeps_its_kinematics(tmp_path) -> None:
    HEADER.save(tmp_path / "campaign.toml")
    assert CampaignHeader.load(tmp_path / "campaign.toml") == HEADER


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": 2}, r'kinematics needs a newer schema: kinematics = "differential" in schema 2 .limit: schema 3'),
        (
            {"schema": 1, "kinematics": "two_axle", "front_axle_m": 0.1, "rear_axle_m": 0.1},
            "command_unit needs a newer",
        ),
    ],
)
def test_an_older_schema_knows_no_kinematics(change, message) -> None:
    with pytest.raises(CampaignError, match=message):
        replace(HEADER, **change)


def test_a_rear_axle_that_is_steered_is_refused():
    with pytest.raises(VehicleError, match="a differential vehicle steers no rear axle"):
        replace(turtle(), rear=turtle().front)
