"""Tables in the thesis' form, and the thesis' own values."""

import numpy as np
import pytest
from statistics_samples import TARGETS, error_table

from agvbench.statistics import end_pose_table
from agvbench.statistics.descriptive import classify_outliers
from agvbench.statistics.end_poses import CASES, published_end_poses, thesis_case
from agvbench.types import Pose


@pytest.fixture(scope="module")
def table():
    rng = np.random.default_rng(0)
    return end_pose_table(error_table(lambda n: rng.normal(0.0, 10.0, n), repeats=10))


def test_one_row_per_trajectory_quantity_and_condition_in_the_order_of_the_thesis(table):
    assert len(table) == (4 * 3 + 4 * 4) * 2
    assert list(table.condition[:2]) == ["uncalibrated", "calibrated"]
    assert list(dict.fromkeys(table.trajectory)) == list(TARGETS)


def test_end_position_and_heading_error_come_first_and_turns_have_their_rotation_too(table):
    readings = {name: list(dict.fromkeys(rows.reading)) for name, rows in table.groupby("trajectory")}
    assert readings["2_backward"] == ["end position error", "heading error", "|Δs|"]
    assert readings["6_forward_right"] == ["end position error", "heading error", "|Δs|", "rotation"]
    rotations = table[table.reading == "rotation"]
    assert rotations["median"].between(80, 100).all()


def test_quartiles_are_ordered_and_absolute(table):
    five = table[["min", "q1", "median", "q3", "max"]].to_numpy()
    assert (np.diff(five, axis=1) >= 0).all()
    assert (five >= 0).all()


def test_published_values_stand_beside_their_own_row(table):
    row = table[(table.case == 5) & (table.quantity == "delta_s_mm") & (table.condition == "calibrated")].iloc[0]
    # Thesis table 8.7, second row.
    assert [row[f"published_{s}"] for s in ("min", "q1", "median", "q3", "max")] == [0.10, 5.89, 8.00, 9.49, 13.40]
    half_speed = table[(table.case == 3) & (table.condition == "uncalibrated")]
    assert half_speed.published_median.isna().all()
    compared = table[table.published_median.notna()]
    assert len(compared) == 28
    assert set(compared[compared.case <= 4].reading) == {"|Δs|", "heading error"}
    assert set(compared[compared.case > 4].reading) == {"|Δs|", "rotation"}


def test_what_the_thesis_published_does_not_stand_beside_another_vehicle():
    errors = error_table(np.zeros, repeats=2)
    assert end_pose_table(errors, thesis_vehicle=False).published_median.isna().all()


def test_published_tables_are_whole():
    published = published_end_poses()
    assert len(published) == 28
    assert set(published.trajectory) == set(CASES)
    five = published[["min", "q1", "median", "q3", "max"]].to_numpy()
    assert (np.diff(five, axis=1) >= 0).all()


@pytest.mark.parametrize(
    ("name", "target", "case"),
    [
        ("3_forward_half_speed", CASES[3], 3),
        ("case_8", CASES[8], 8),
        ("trajectory 6", CASES[6], 6),
        ("forward", CASES[1], None),
        ("6_forward", CASES[5], None),
        ("r1.5_arc", CASES[5], None),
        ("18_forward", CASES[1], None),
        ("5_left", Pose(1.0, 1.03, np.pi / 2), None),
    ],
)
def test_which_trajectory_of_the_thesis_it_is(name, target, case):
    assert thesis_case(name, target) == case


def test_outliers_by_side_and_severity():
    # The quartiles of these 24 are 1.97 and 8.03: mild beyond −7.1 and 17.1, severe beyond −16.2 and 26.2.
    found = classify_outliers(np.array([-100.0, -11.0, *np.linspace(0, 10, 20), 25.0, 90.0]))
    assert (found.low_severe, found.low_mild, found.high_mild, found.high_severe) == (1, 1, 1, 1)
    assert str(found) == "1 low severe, 1 low mild, 1 high mild, 1 high severe"
    assert classify_outliers(np.array([0.0, 0.0, 0.0, 99.0])).count == 0
