"""Appendix B: mirrored halves, and the loss fitted to it."""

import math

import numpy as np
import pytest

from agvbench.errors import FileError
from agvbench.thesis.refits.cornering import (
    FORMS,
    cornering_share,
    count_mirrored,
    expected_differing,
    fit_loss,
    fitted_loss,
    held_out_rms_mm,
    identical_blocks,
    samples,
    steering_measure,
    straight_speeds_repeated,
)
from agvbench.thesis.refits.idle_axle import common_lever_arm, slope_and_error
from agvbench.thesis.tables import CorneringTable, cornering_table, load_table


def test_143_of_144_mirrored_pairs_are_identical():
    count = count_mirrored()
    assert (count.pairs, count.identical, count.at_rest) == (144, 143, 18)
    assert count.differing == ("1750 µs, crab, 900/2100: 0.26 and 0.27 m/s",)


def test_mirrored_pairs_counted_from_the_bare_rows():
    rows = load_table("appendix_b_cornering_speed").to_dict("records")
    speed = {(r["drive_pulse_us"], r["mode"], int(r["steering_pulse_us"])): r["speed_mps"] for r in rows}
    pairs = [(key, (*key[:2], 3000 - key[2])) for key in speed if key[2] < 1500]
    assert sum(float(speed[a]) == float(speed[b]) for a, b in pairs) == 143
    assert len(pairs) == 144


def test_repeated_straight_speeds_and_blocks():
    assert straight_speeds_repeated() == 16
    assert identical_blocks() == [(1850.0, 2100.0)]


def test_a_table_that_was_driven_twice_is_not_called_mirrored():
    table = cornering_table()
    shifted = {mode: grid + np.where(table.steering_us > 1500.0, 0.01, 0.0) for mode, grid in table.speed_mps.items()}
    count = count_mirrored(CorneringTable(table.drive_us, table.steering_us, shifted))
    assert count.identical == 0
    assert len(count.differing) == 144


def test_expected_differing_against_random_drives():
    left, right, noise = 0.2132, 0.2168, 0.002
    grid = np.array([[left, 0.3, right]])
    rng = np.random.default_rng(1)
    printed = np.round(np.array([[left], [right]]) + noise * rng.standard_normal((2, 100_000)), 2)
    share = np.mean(printed[0] != printed[1])
    assert expected_differing({"single": grid}, noise) == pytest.approx(share, abs=0.01)


def test_identical_halves_far_from_a_rounding_edge_never_differ():
    grid = np.array([[0.21, 0.3, 0.21]])
    assert expected_differing({"single": grid}, 1e-4) == pytest.approx(0.0, abs=1e-12)


def test_loss_is_the_least_squares_one():
    s = samples()

    def rms(loss):
        form = steering_measure(s.front_rad, s.rear_rad)
        lf, lr = 0.181, 0.121

        def eq_5_6(f, r):
            return (np.cos(f) + np.cos(r)) / (2 * np.cos(np.arctan((lf * np.tan(r) + lr * np.tan(f)) / (lf + lr))))

        neutral_f, neutral_r = math.radians(-1.59), math.radians(-2.27)
        neutral = abs(math.tan(neutral_f)) + abs(math.tan(neutral_r))
        share = (
            eq_5_6(s.front_rad, s.rear_rad) / eq_5_6(neutral_f, neutral_r) * (1 - loss * form) / (1 - loss * neutral)
        )
        return float(np.sqrt(np.mean((s.speed_mps - s.straight_mps * share) ** 2)))

    grid = np.linspace(0.0, 0.1, 1001)
    assert fitted_loss() == pytest.approx(grid[np.argmin([rms(c) for c in grid])], abs=5e-4)
    assert rms(fitted_loss()) < 0.75 * rms(0.0)


def test_angle_forms_beat_curvature_forms_held_out():
    errors = {name: held_out_rms_mm(form) for name, form in FORMS.items()}
    assert max(errors[n] for n in FORMS if "curvature" not in n) < min(errors[n] for n in FORMS if "curvature" in n)


def test_left_out_pairs_do_not_enter_the_fit():
    s = samples()
    kept = s.pair_us != 600.0
    assert fit_loss(steering_measure, kept) != pytest.approx(fitted_loss(), abs=1e-4)


def test_share_of_straight_driving_is_one():
    assert float(cornering_share(0.0, 0.0, 0.3)) == 1.0


def test_lever_arm_from_rigid_body_geometry():
    """A vehicle whose markers sit 4 mm further back than its file says, turning about known centres."""
    lr, shift = 0.121, -0.004
    curvature = np.linspace(-2.8, 2.8, 13)
    ahead_of_centre = 0.03 * curvature / 2.8  # of the true centroid, against the centre's projection
    axle = -lr - shift  # the true rear axle, from the true centroid
    true = (axle + ahead_of_centre) * curvature
    measured = (-lr + ahead_of_centre) * curvature
    slope, error, left = slope_and_error(curvature, measured - true)
    assert slope == pytest.approx(shift, abs=1e-12)
    assert error < 1e-12
    assert left < 1e-12


def test_lever_arm_of_the_tables():
    arm, error = common_lever_arm()
    assert arm == pytest.approx(-0.004, abs=0.001)
    assert abs(arm) > 5 * error


def test_a_missing_table_is_one_line():
    with pytest.raises(FileError, match="table of the thesis cannot be read") as info:
        load_table("table_9_9")
    assert "\n" not in str(info.value)
