"""The thesis' printed figures come back from its tables; truth here is the printed text, typed anew."""

import csv
import math

import numpy as np
import pytest

from agvbench.resources import resource_directory
from agvbench.thesis.refits.battery import battery_section, fit_droop, held_out_errors
from agvbench.thesis.refits.drive import cubic_map, drive_section, printed_cubic, refit_drive
from agvbench.thesis.refits.polynomial import fit_polynomial
from agvbench.thesis.refits.steering import neutral_error_deg, published_lines, refit_line, steering_section
from agvbench.thesis.tables import GEOMETRY, end_pose_rows, endurance_table


def column(table, name):
    path = resource_directory("reports") / "reference" / "thesis" / f"{table}.csv"
    with path.open(encoding="utf-8") as stream:
        return np.array([float(row[name]) for row in csv.DictReader(stream)])


@pytest.mark.parametrize(
    ("axle", "dropped", "slope", "intercept", "r_squared"),
    [
        ("front", 1, -0.08397, 124.997, 0.9991),
        ("rear", 1, -0.08365, 123.552, 0.9954),
        ("front", 2, -0.0861, 128.129, 0.9999),
        ("rear", 2, -0.0880, 129.673, 0.9998),
    ],
)
def test_steering_lines(axle, dropped, slope, intercept, r_squared):
    line = refit_line(axle, dropped)
    assert line.coefficients[0] == pytest.approx(slope, abs=6e-5)
    assert line.coefficients[1] == pytest.approx(intercept, abs=6e-4)
    assert round(line.r_squared, 4) == r_squared


@pytest.mark.parametrize(
    ("order", "span", "r_squared"),
    [
        (1, (900.0, 2100.0), 0.9234),
        (3, (900.0, 2100.0), 0.9917),
        (1, (1200.0, 1850.0), 0.9837),
        (3, (1200.0, 1850.0), 0.9949),
    ],
)
def test_table_7_5(order, span, r_squared):
    assert round(refit_drive(order, span).r_squared, 4) == r_squared


def test_polynomial_against_normal_equations():
    pulse = column("table_7_1_front_servo_varied", "pulse_us")[1:-1]
    angle = column("table_7_1_front_servo_varied", "front_median_deg")[1:-1]
    design = np.stack([pulse, np.ones_like(pulse)], axis=1)
    expected = np.linalg.solve(design.T @ design, design.T @ angle)
    fitted = fit_polynomial(pulse, angle, 1)
    assert fitted.coefficients == pytest.approx(tuple(expected), rel=1e-9)
    r = np.corrcoef(pulse, angle)[0, 1]
    assert fitted.r_squared == pytest.approx(r**2, rel=1e-12)


def test_refitted_cubic_has_the_digits_that_eq_7_3_lost():
    assert refit_drive(3, (1200.0, 1850.0)).coefficients == pytest.approx(
        (3.7419e-9, -1.69804e-5, 2.43017e-2, -10.85699), rel=2e-5
    )
    assert printed_cubic(1500.0) == pytest.approx(-0.4875, abs=1e-9)
    assert float(cubic_map()(cubic_map().inverse(-0.32))) == pytest.approx(-0.32, abs=1e-9)


def test_every_printed_figure_of_chapter_7_agrees():
    for section in (steering_section(), drive_section()):
        figures = section.tables[0].records()
        assert figures
        assert [f["figure"] for f in figures if not f["agree"]] == []


def test_published_lines_are_the_printed_ones():
    front, rear = published_lines()
    assert math.degrees(float(front(1000.0))) == pytest.approx(125.00 - 84.0, abs=1e-9)
    assert math.degrees(float(rear(2000.0))) == pytest.approx(123.55 - 167.4, abs=1e-9)


def test_published_lines_do_not_drive_straight():
    pulse = 123.55 / 0.0837
    slope, intercept = np.polyfit(
        column("table_7_2_rear_servo_varied", "pulse_us")[2:-2],
        column("table_7_2_rear_servo_varied", "rear_median_deg")[2:-2],
        1,
    )
    assert neutral_error_deg("rear") == pytest.approx(slope * pulse + intercept, abs=1e-6)
    assert neutral_error_deg("rear") < -0.2


def test_battery():
    section = battery_section()
    hours = column("table_8_2_endurance_intervals", "start_s") / 3600.0
    speed = column("table_8_2_endurance_intervals", "speed_mps")
    slope, initial = np.polyfit(hours, speed, 1)
    assert section.values["droop_per_hour"] == pytest.approx(-slope / initial)
    constant, line = held_out_errors()
    assert np.sqrt(np.mean(line**2)) < 0.5 * np.sqrt(np.mean(constant**2))
    # Leaving one out of n, a mean's error is the residual times n / (n - 1).
    assert constant == pytest.approx((speed - speed.mean()) * len(speed) / (len(speed) - 1))
    assert fit_droop(hours, np.full_like(hours, 0.3)).per_hour == pytest.approx(0.0, abs=1e-12)


def test_tables_are_whole():
    assert len(end_pose_rows()) == 28
    assert endurance_table()[0][-1] == 30000.0
    assert GEOMETRY.wheelbase_m == pytest.approx(0.302)
