"""Each hidden effect does what its equation says, checked by a truth written here."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hidden_truth import FULL_MPS, HALF_MPS, LF, LR, START, integrate, motion, poses, quiet

from agvbench.simulator.hidden.catalogue import CATALOGUE

A, B = 0.3, -0.2  # front and rear angles of the turn [rad]
TURN = [(1.0, 1.0, 0.0, 0.0), (1.5, 1.0, A, B)]  # straight, then a turn, at full speed
ENDS = (1.0, 2.5)
REST = (0.5, 0.0, A, B)
TIGHT = 2e-6  # metres, radians


def planted(name, **sizes):
    return quiet(**CATALOGUE[name].constants(sizes))


def step(before, after, at=1.0):
    return lambda t: before if t < at else after


def constant(value):
    return lambda t: value


def turn_truth(**changes):
    given = {"front": step(0.0, A), "rear": step(0.0, B), "speed": constant(FULL_MPS)} | changes
    return integrate(ENDS, **given)


def check(found, wanted, tolerance=TIGHT):
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=tolerance)


def test_base_plant_is_static_maps_and_the_thesis_kinematics():
    check(poses(quiet(), TURN), turn_truth())


def test_base_plant_stands_within_the_dead_band_and_at_the_end_stops():
    still = poses(quiet(), [(1.0, 0.049, 0.3, 0.0)])
    assert np.all(still == still[0])
    stopped, limit = poses(quiet(), [(1.0, 1.0, 0.8, 0.0)]), poses(quiet(), [(1.0, 1.0, 0.7, 0.0)])
    check(stopped, limit, 1e-12)


@pytest.mark.parametrize("name", ["actuation_delay", "mocap_latency"])
def test_delays_shift_the_path_in_time(name):
    size = {"actuation_delay": {"delay_s": 0.14}, "mocap_latency": {"latency_s": 0.14}}[name]
    shifted, base = poses(planted(name, **size), [*TURN, REST]), poses(quiet(), [*TURN, REST])
    check(shifted[7:], base[:-7])
    check(shifted[:7], np.tile(START, (7, 1)), 1e-12)


def test_uneven_delay_lets_the_drive_answer_first():
    plant = planted("actuation_delay_uneven", delay_s=0.2, drive_share=0.5)
    found = poses(plant, TURN)
    wanted = integrate((0.1, 1.2, 2.5), step(0.0, A, 1.2), step(0.0, B, 1.2), step(0.0, FULL_MPS, 0.1))
    check(found, wanted)


def test_smoothed_latency_is_a_first_order_filter_of_the_pose():
    found = poses(planted("mocap_latency_smoothed", time_constant_s=0.1), [(2.0, 1.0, 0.0, 0.0)], start=(0.0, 0.0, 0.0))
    t = 0.02 * np.arange(1, 101)
    check(found[:, 0], FULL_MPS * (t - 0.1 * (1.0 - np.exp(-t / 0.1))), 3e-4)  # filtered once per step


def test_steering_lag_is_exponential():
    def lagged(angle):
        return lambda t: 0.0 if t < 1.0 else angle * (1.0 - math.exp(-(t - 1.0) / 0.2))

    found = poses(planted("steering_lag", time_constant_s=0.2), TURN)
    check(found, turn_truth(front=lagged(A), rear=lagged(B)))


def test_second_order_lag_is_critically_damped_at_damping_one():
    def lagged(angle):
        return lambda t: 0.0 if t < 1.0 else angle * (1.0 - (1.0 + 9.0 * (t - 1.0)) * math.exp(-9.0 * (t - 1.0)))

    found = poses(planted("steering_lag_second_order", frequency_rad_per_s=9.0, damping=1.0), TURN)
    check(found, turn_truth(front=lagged(A), rear=lagged(B)))


def test_rate_limit_is_a_ramp():
    def ramp(angle):
        return lambda t: math.copysign(min(abs(angle), max(0.0, t - 1.0)), angle)

    found = poses(planted("steering_rate_limit", rate_rad_per_s=1.0), TURN)
    wanted = integrate((1.0, 1.2, 1.3, 2.5), ramp(A), ramp(B), constant(FULL_MPS))[:, :]
    check(found, wanted, 2e-5)


def test_accelerated_rate_limit_takes_the_time_of_a_trapezoid():
    plant = planted("steering_rate_limit_accelerated", rate_rad_per_s=1.0, acceleration_rad_per_s2=10.0)
    headings = poses(plant, [(1.0, 1.0, 0.0, 0.0), (2.0, 1.0, A, 0.0)])[:, 2]
    at_once = poses(quiet(), [(1.0, 1.0, 0.0, 0.0), (2.0, 1.0, A, 0.0)])[:, 2]
    rate = motion(A, 0.0, FULL_MPS, FULL_MPS)[2]
    # Symmetric profiles lose half their duration, 0.3 s of ramp and 0.1 s of acceleration, but for the tangent's bend.
    assert (at_once - headings)[-1] / rate == pytest.approx(0.5 * (A + 0.1), rel=0.03)
    slow = poses(planted("steering_rate_limit", rate_rad_per_s=1.0), [(1.0, 1.0, 0.0, 0.0), (2.0, 1.0, A, 0.0)])[:, 2]
    assert (slow - headings)[-1] > 0.03 * rate


def test_backlash_stays_half_its_width_behind_on_either_side():
    rows = [(1.0, 1.0, A, 0.0), (1.0, 1.0, -A, 0.0), (1.0, 1.0, 0.0, 0.0)]
    found = np.diff(poses(planted("steering_backlash", width_rad=0.06), rows)[:, 2])
    for index, angle in ((25, A - 0.03), (75, -A + 0.03), (125, -0.03)):
        assert found[index] / 0.02 == pytest.approx(motion(angle, 0.0, FULL_MPS, FULL_MPS)[2], rel=1e-6)


def test_saturation_limits_each_axle():
    found = poses(planted("steering_saturation", front_rad=0.25, rear_rad=0.1), TURN)
    check(found, turn_truth(front=step(0.0, 0.25), rear=step(0.0, -0.1)))


def test_coupling_takes_the_other_axles_own_angle():
    found = poses(planted("axle_coupling", front_from_rear=0.1, rear_from_front=-0.05), TURN)
    check(found, turn_truth(front=step(0.0, A + 0.1 * B), rear=step(0.0, B - 0.05 * A)))


def test_reverse_gain_acts_backward_only():
    plant = planted("reverse_steering_gain", gain=0.1)
    check(poses(plant, TURN), poses(quiet(), TURN), 0.0)
    found = poses(plant, [(1.5, -1.0, A, B)])
    check(found, integrate((1.5,), constant(1.1 * A), constant(1.1 * B), constant(-FULL_MPS)))


def test_speed_lag_accelerates_and_brakes_by_its_own_times():
    rows = [(1.0, 1.0, A, B), REST]
    top = FULL_MPS * (1.0 - math.exp(-1.0 / 0.3))

    def speed(t):
        return FULL_MPS * (1.0 - math.exp(-t / 0.3)) if t < 1.0 else top * math.exp(-(t - 1.0) / 0.1)

    found = poses(planted("speed_lag", accelerate_s=0.3, brake_s=0.1), rows)
    check(found, integrate((1.0, 1.5), constant(A), constant(B), speed))


def test_speed_ramp_is_uniform_acceleration():
    found = poses(planted("speed_lag_ramp", acceleration_mps2=0.5), [(2.0, 1.0, 0.0, 0.0)], start=(0.0, 0.0, 0.0))
    assert found[-1, 0] == pytest.approx(2.0 * FULL_MPS - FULL_MPS**2 / (2.0 * 0.5), abs=2e-6)
    assert found[19, 0] == pytest.approx(0.5 * 0.5 * 0.4**2, abs=2e-6)


def test_dead_band_stops_below_its_width_and_leaves_the_rest():
    plant = quiet(drive_dead=0.0, **CATALOGUE["drive_dead_band"].constants({"width": 120.0}))
    still = poses(plant, [(1.0, 0.199, 0.0, 0.0)])
    assert np.all(still == still[0])
    assert poses(plant, [(1.0, 0.201, 0.0, 0.0)], start=(0, 0, 0))[-1, 0] == pytest.approx(5.6e-4 * 120.6, rel=1e-9)


@pytest.mark.parametrize(
    ("name", "size", "left"),
    [
        ("cornering_speed_loss", {"loss": 0.1}, 1.0 - 0.1 * (math.tan(A) - math.tan(B))),
        ("cornering_speed_loss_square", {"loss_per_rad2": 0.3}, 1.0 - 0.3 * (A * A + B * B)),
    ],
)
def test_cornering_costs_speed(name, size, left):
    found = poses(planted(name, **size), TURN)
    check(found, turn_truth(speed=step(FULL_MPS, left * FULL_MPS)))


@pytest.mark.parametrize(
    ("name", "size", "left"),
    [
        ("battery_droop", {"per_hour": 0.1}, lambda h: 1.0 - 0.1 * h),
        ("battery_droop_exponential", {"share": 0.2, "time_constant_h": 0.5}, lambda h: 0.8 + 0.2 * math.exp(-h / 0.5)),
    ],
)
def test_droop_follows_the_hours_of_the_session_through_resets(name, size, left):
    plant = planted(name, **size)
    plant.reset((0.0, 0.0, 0.0), seed=1)
    plant.advance(1500.0, 1500.0, 1500.0, 600.0)
    plant.reset((0.0, 0.0, 0.0), seed=2)  # 15 s of turnaround
    x, _, _ = plant.advance(900.0, 1500.0, 1500.0, 1.0)
    assert x == pytest.approx(FULL_MPS * left(615.5 / 3600.0), abs=1e-6)


@pytest.mark.parametrize(
    ("name", "size", "bend"),
    [
        ("lateral_slip", {"gradient": 2.0}, lambda c, v: c / (1.0 + 2.0 * v * v)),
        ("lateral_slip_linear", {"gradient_s_per_m": 0.4}, lambda c, v: c / (1.0 + 0.4 * abs(v))),
        ("wheel_diameter_mismatch", {"curvature_per_m": 0.1}, lambda c, v: c + 0.1),
    ],
)
def test_curvature_effects(name, size, bend):
    check(poses(planted(name, **size), TURN), turn_truth(bend=bend))
    found = poses(planted(name, **size), [(1.0, -0.5, A, 0.0)])
    check(found, integrate((1.0,), constant(A), constant(0.0), constant(-HALF_MPS), bend=bend))


def test_a_wheelbase_that_is_longer_has_each_axle_half_of_it_farther_away():
    axles = (LF + 0.05 * (LF + LR), LR + 0.05 * (LF + LR))
    check(poses(planted("wheelbase_error", longer=0.1), TURN), turn_truth(axles=axles))


def test_axle_speed_mismatch_is_in_equation_5_6():
    check(poses(planted("axle_speed_mismatch", ratio=0.15), TURN), turn_truth(ratio=1.15))


@pytest.mark.parametrize(("front", "rear"), [(0.5, 0.0), (-0.2, 0.6), (0.5, -0.5)])
def test_overrun_lets_the_slower_axle_count_more(front, rear):
    slower, faster = sorted([math.cos(front), math.cos(rear)])
    mean = 0.5 * (slower + faster)
    usual, braked = (
        np.hypot(*np.diff(poses(plant, [(1.0, 1.0, front, rear)])[-2:, :2], axis=0)[0])
        for plant in (quiet(), planted("axle_overrun", excess=2.0))
    )
    assert braked / usual == pytest.approx((3.0 * slower + faster) / 4.0 / mean, rel=1e-4)


@pytest.mark.parametrize(("front", "rear"), [(0.5, 0.0), (-0.2, 0.6), (0.5, -0.5)])
def test_a_differential_keeps_the_mean_of_the_wheels_speeds(front, rear):
    usual, shared = (
        np.hypot(*np.diff(poses(plant, [(1.0, 1.0, front, rear)])[-2:, :2], axis=0)[0])
        for plant in (quiet(), planted("axle_differential", share=1.0))
    )
    wheels = [shared / usual * 0.5 * (math.cos(front) + math.cos(rear)) / math.cos(axle) for axle in (front, rear)]
    assert np.mean(wheels) == pytest.approx(1.0, rel=1e-4)


def test_tilt_drifts_in_the_floor_frame_while_moving_not_at_rest():
    plant = planted("floor_tilt", drift_mps=0.01, direction_rad=2.0)
    drift = (0.01 * math.cos(2.0), 0.01 * math.sin(2.0))
    found = poses(plant, [*TURN, REST])
    check(found[:125], turn_truth(extra=lambda v: drift))
    assert np.all(found[125:] == found[125])


def test_proportional_tilt_drifts_with_the_speed():
    c, s = 0.03 * math.cos(2.0), 0.03 * math.sin(2.0)
    found = poses(planted("floor_tilt_proportional", share=0.03, direction_rad=2.0), [(1.5, -0.5, A, B)])
    truth = integrate((1.5,), constant(A), constant(B), constant(-HALF_MPS), extra=lambda v: (abs(v) * c, abs(v) * s))
    check(found, truth)


def test_marker_offset_moves_the_centroid_with_the_body():
    """Relative to the start the seen path is the true path of the displaced point."""
    found = poses(planted("marker_offset", forward_m=0.02, left_m=-0.03), TURN)
    heading = START[2]
    arm = np.array(
        [math.cos(heading) * 0.02 + math.sin(heading) * 0.03, math.sin(heading) * 0.02 - math.cos(heading) * 0.03]
    )
    true = integrate(
        ENDS, step(0.0, A), step(0.0, B), constant(FULL_MPS), start=(START[0] - arm[0], START[1] - arm[1], heading)
    )
    c, s = np.cos(true[:, 2]), np.sin(true[:, 2])
    check(found[:, 0], true[:, 0] + c * 0.02 + s * 0.03)
    check(found[:, 1], true[:, 1] + s * 0.02 - c * 0.03)
    check(found[:, 2], true[:, 2])


def test_heading_misalignment_adds_to_the_measured_heading_only():
    found = poses(planted("heading_misalignment", angle_rad=0.04), TURN)
    true = integrate(ENDS, step(0.0, A), step(0.0, B), constant(FULL_MPS), start=(START[0], START[1], START[2] - 0.04))
    check(found, true + np.array([0.0, 0.0, 0.04]))


def test_scale_stretches_positions_about_the_room():
    found = poses(planted("mocap_scale", scale=0.03), TURN)
    true = integrate(
        ENDS, step(0.0, A), step(0.0, B), constant(FULL_MPS), start=(START[0] / 1.03, START[1] / 1.03, START[2])
    )
    check(found, true * [1.03, 1.03, 1.0])


def test_lens_bends_with_the_square_of_the_distance():
    found = poses(planted("lens_distortion", per_m2=0.02), [(4.0, 1.0, 0.0, 0.0)], start=(0.0, 0.0, 0.0))
    true = FULL_MPS * 0.02 * np.arange(1, 201)
    check(found[:, 0], true * (1.0 + 0.02 * true**2))
    assert poses(planted("lens_distortion", per_m2=0.02), [(0.02, 0.0, 0.0, 0.0)])[0] == pytest.approx(START, abs=1e-12)


def test_patch_is_slow_inside_its_disc():
    plant = planted("slow_patch", loss=0.3, x_m=0.5, y_m=0.0, radius_m=0.2)
    found = poses(plant, [(4.0, 1.0, 0.0, 0.0)], start=(0.0, 0.0, 0.0))
    in_full, inside = 0.3 / FULL_MPS, 0.4 / (0.7 * FULL_MPS)
    assert found[-1, 0] == pytest.approx(0.7 + FULL_MPS * (4.0 - in_full - inside), abs=5e-4)
    beside = poses(plant, [(4.0, 1.0, 0.0, 0.0)], start=(0.0, 0.25, 0.0))
    assert beside[-1, 0] == pytest.approx(4.0 * FULL_MPS, abs=1e-9)


def test_seam_kicks_where_it_is_crossed_and_back_again():
    plant = planted("floor_seam", kick_rad=0.05, place_m=0.3, direction_rad=0.0)
    found = poses(plant, [(2.0, 1.0, 0.0, 0.0), (2.0, -1.0, 0.0, 0.0)], start=(0.0, 0.0, 0.0))
    crossed = round(0.3 / FULL_MPS / 0.02)
    assert np.all(found[: crossed - 2, 2] == 0.0)
    assert np.all(found[crossed + 1 : 100, 2] == 0.05)
    assert found[-1, 2] == 0.0


def test_nap_depends_on_the_heading_on_the_floor():
    for heading in (0.0, 1.0, 3.0):
        found = poses(
            planted("floor_nap", share=0.05, direction_rad=1.0), [(1.0, 1.0, 0.0, 0.0)], start=(0.0, 0.0, heading)
        )
        assert math.hypot(*found[-1, :2]) == pytest.approx(FULL_MPS * (1.0 + 0.05 * math.cos(heading - 1.0)), abs=1e-9)


def test_runout_comes_back_after_a_period_of_distance():
    plant = planted("wheel_runout", share=0.08, period_m=0.4, phase_rad=0.0)
    headings = poses(plant, [(4.0, 1.0, 0.0, 0.0)], start=(0.0, 0.0, 0.0))[:, 2]
    rolled = FULL_MPS * 0.02 * np.arange(1, 201)
    swing = 0.08 / 0.16 * 0.4 / (2.0 * math.pi)
    check(headings, -swing * (1.0 - np.cos(2.0 * math.pi * rolled / 0.4)), 1e-6)


def test_servo_warms_with_the_sessions_time():
    plant = planted("servo_warm_up", gain=0.1, time_constant_h=0.5)
    fresh = poses(plant, [(1.0, 1.0, A, 0.0)])[-1, 2] - START[2]
    plant.advance(1500.0, 1500.0, 1500.0, 600.0)
    warm = poses(plant, [(1.0, 1.0, A, 0.0)])[-1, 2] - START[2]
    assert fresh == pytest.approx(motion(A, 0.0, FULL_MPS, FULL_MPS)[2], rel=1e-4)
    gain = 1.0 + 0.1 * (1.0 - math.exp(-616.5 / 1800.0))
    assert warm == pytest.approx(motion(gain * A, 0.0, FULL_MPS, FULL_MPS)[2], rel=1e-4)


def test_sag_begins_anew_with_every_start():
    plant = planted("speed_sag", share=0.1, time_constant_s=2.0)
    found = poses(plant, [(3.0, 1.0, 0.0, 0.0), (0.5, 0.0, 0.0, 0.0), (3.0, 1.0, 0.0, 0.0)], start=(0.0, 0.0, 0.0))
    driven = FULL_MPS * (3.0 - 0.1 * (3.0 - 2.0 * (1.0 - math.exp(-1.5))))
    assert found[149, 0] == pytest.approx(driven, abs=1e-4)
    assert found[-1, 0] == pytest.approx(2.0 * driven, abs=2e-4)


def test_stick_slip_twists_on_the_spot_at_each_start():
    found = poses(planted("stick_slip", twist_rad=0.03, duration_s=0.1), [(1.0, 1.0, 0.0, 0.0)], start=(0.0, 0.0, 0.0))
    assert found[4, :2] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert found[-1, 2] == pytest.approx(0.03, rel=0.02)
    assert math.hypot(*found[-1, :2]) == pytest.approx(0.9 * FULL_MPS, rel=0.003)


def test_servo_hysteresis_falls_short_by_a_share_of_the_way():
    rows = [(1.0, 1.0, A, 0.0), (1.0, 1.0, -A, 0.0)]
    found = np.diff(poses(planted("servo_hysteresis", share=0.1), rows)[:, 2]) / 0.02
    reached = 0.9 * A
    back = -A + 0.1 * (reached + A)
    assert found[25] == pytest.approx(motion(reached, 0.0, FULL_MPS, FULL_MPS)[2], rel=1e-6)
    assert found[75] == pytest.approx(motion(back, 0.0, FULL_MPS, FULL_MPS)[2], rel=1e-6)


def test_torque_steers_one_way_ahead_and_the_other_way_back():
    plant = planted("torque_steer", angle_rad=0.02)
    for share, angle in ((1.0, 0.02), (-1.0, -0.02)):
        turned = poses(plant, [(1.0, share, 0.0, 0.0)])[-1, 2] - START[2]
        assert turned == pytest.approx(share * FULL_MPS * motion(angle, 0.0, 1.0, 1.0)[2], rel=1e-6)


def changing(name, **sizes):
    """A plant that changes, with a turnaround of a quarter of an hour."""
    recipe = CATALOGUE[name]
    return quiet(turnaround_s=900.0, changes=[recipe.change(sizes)], **recipe.constants(sizes))


def ends_by_hour(plant, rows, start=START):
    """The end poses of five runs that begin at 0 h, 0.25 h, 0.5 h, … and the few seconds that the runs before took."""
    return [poses(plant, rows, start)[-1] for _ in range(5)]


def test_steering_gain_fades_exponentially_with_the_sessions_time():
    plant = changing("steering_gain_fade", gain=-0.1, time_constant_h=0.5)
    for run, end in enumerate(ends_by_hour(plant, [(1.0, 1.0, A, 0.0)])):
        gain = 1.0 - 0.1 * (1.0 - math.exp(-run * 901.0 / 1800.0))
        assert end[2] - START[2] == pytest.approx(motion(gain * A, 0.0, FULL_MPS, FULL_MPS)[2], rel=1e-4)


def test_trim_of_the_front_axle_steps_once():
    plant = changing("steering_trim_step", angle_rad=0.04, begins_h=0.6)
    for run, end in enumerate(ends_by_hour(plant, [(1.0, 1.0, A, 0.0)])):
        angle = A + (0.04 if run >= 3 else 0.0)
        assert end[2] - START[2] == pytest.approx(motion(angle, 0.0, FULL_MPS, FULL_MPS)[2], rel=1e-4)


def test_bumped_markers_turn_the_path_about_the_start_that_the_camera_sees():
    plant = changing("marker_bump", angle_rad=0.03, forward_m=0.0, left_m=0.0, begins_h=0.6)
    for run, end in enumerate(ends_by_hour(plant, [(1.0, 1.0, 0.0, 0.0)], (0.0, 0.0, 0.0))):
        turned = -0.03 if run >= 3 else 0.0
        check(end, [FULL_MPS * math.cos(turned), FULL_MPS * math.sin(turned), 0.0])


def test_displaced_markers_swing_with_the_heading():
    plant = changing("marker_bump", angle_rad=0.0, forward_m=0.02, left_m=-0.01, begins_h=0.1)
    before, after = (np.array(end) for end in ends_by_hour(plant, [(1.0, 1.0, A, 0.0)], (0.0, 0.0, 0.0))[:2])
    c, s = math.cos(after[2]), math.sin(after[2])
    swing = np.array([c * 0.02 + s * 0.01 - 0.02, s * 0.02 - c * 0.01 + 0.01])
    check(after - before, [*swing, 0.0])


def test_wind_blows_in_a_part_of_the_session():
    plant = changing("wind_in_a_part", drift_mps=0.01, direction_rad=1.0, begins_h=0.4, ends_h=0.8)
    ends = np.array(ends_by_hour(plant, [(1.0, 1.0, 0.0, 0.0)], (0.0, 0.0, 0.0)))
    blown = np.array(
        [[0.01 * math.cos(1.0), 0.01 * math.sin(1.0), 0.0] if run in {2, 3} else [0.0] * 3 for run in range(5)]
    )
    check(ends - [FULL_MPS, 0.0, 0.0], blown)


def test_speed_steps_at_a_battery_change():
    plant = changing("battery_change", loss=0.08, begins_h=0.4)
    ends = np.array(ends_by_hour(plant, [(1.0, 1.0, 0.0, 0.0)], (0.0, 0.0, 0.0)))
    assert ends[:, 0] == pytest.approx(FULL_MPS * np.array([1.0, 1.0, 0.92, 0.92, 0.92]), abs=1e-6)


def test_clock_falls_behind_exponentially():
    plant = changing("clock_drift", latency_s=0.2, time_constant_h=1.0)
    ends = np.array(ends_by_hour(plant, [(1.0, 1.0, 0.0, 0.0)], (0.0, 0.0, 0.0)))
    late_s = 0.2 * (1.0 - np.exp(-np.arange(5) * 901.0 / 3600.0))
    assert ends[:, 0] == pytest.approx(FULL_MPS * (1.0 - late_s), abs=1e-6)


def test_every_effect_is_checked_here():
    """An effect that is added without a check of its equation fails here."""
    source = Path(__file__).read_text(encoding="utf-8")
    assert [name for name in CATALOGUE if f'"{name}"' not in source] == []
