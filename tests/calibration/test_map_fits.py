"""Fits of the thesis' tables as it printed them, and maps whose truth is known."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from agvbench.calibration import (
    CurvePoints,
    compare_maps,
    drive_fitters,
    fit_drive_map,
    fit_steering_map,
    steering_fitters,
)
from agvbench.errors import FitError, InputError
from agvbench.resources import resource_directory

PULSES = np.arange(900.0, 2101.0, 100.0)


def column(table, command, value):
    path = resource_directory("reports") / "reference" / "thesis" / table
    with path.open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    return np.array([float(row[command]) for row in rows]), np.array([float(row[value]) for row in rows])


def steering(axle):
    number = {"front": 1, "rear": 2}[axle]
    pulse, degrees = column(f"table_7_{number}_{axle}_servo_varied.csv", "pulse_us", f"{axle}_median_deg")
    return pulse, np.radians(degrees)


DRIVE = column("table_7_4_straight_speed.csv", "drive_pulse_us", "speed_mps")


@pytest.mark.parametrize(
    ("axle", "slope", "intercept", "r_squared"),
    [("front", -0.08397, 124.997, 0.9991), ("rear", -0.08365, 123.552, 0.9954)],
)
def test_steering_lines_of_the_thesis(axle, slope, intercept, r_squared):
    fit = fit_steering_map(*steering(axle), "thesis")
    assert np.degrees(fit.map.slope) == pytest.approx(slope, abs=5e-6)
    assert np.degrees(fit.map.intercept) == pytest.approx(intercept, abs=1e-3)
    assert fit.r_squared == pytest.approx(r_squared, abs=5e-5)
    assert [out.command for out in fit.left_out] == [900.0, 2100.0]
    assert all("outermost" in out.why for out in fit.left_out)


@pytest.mark.parametrize(
    ("axle", "slope", "r_squared", "high_deg", "low_deg"),
    [("front", -0.0861, 0.9999, 40.19, -41.64), ("rear", -0.0880, 0.9998, 39.81, -39.47)],
)
def test_end_stops_are_found_and_the_slope_is_freed_of_them(axle, slope, r_squared, high_deg, low_deg):
    fit = fit_steering_map(*steering(axle))
    assert fit.name == "line_with_end_stops"
    assert np.degrees(fit.map.slope) == pytest.approx(slope, abs=5e-5)
    assert np.degrees(fit.map.output_range) == pytest.approx([low_deg, high_deg], abs=0.01)
    inner = slice(2, -2)
    pulse, angle = steering(axle)
    error = angle[inner] - fit.map(pulse[inner])
    assert 1 - np.sum(error**2) / np.sum((angle[inner] - angle[inner].mean()) ** 2) == pytest.approx(
        r_squared, abs=5e-5
    )
    thesis = fit_steering_map(pulse, angle, "thesis")
    assert thesis.rms_all > 3 * fit.rms_all


def test_drive_fits_of_the_thesis():
    partial = fit_drive_map(*DRIVE, "thesis", neutral=1500.0)
    assert partial.r_squared == pytest.approx(0.9949, abs=5e-5)
    assert sorted(out.command for out in partial.left_out) == [*np.arange(900, 1151, 50), *np.arange(1900, 2101, 50)]
    found = [partial.map.cubic, partial.map.quadratic, partial.map.linear, partial.map.constant]
    assert found == pytest.approx([3.7419e-9, -1.69804e-5, 2.43017e-2, -10.85699], rel=5e-5)
    kept = (DRIVE[0] >= 1200) & (DRIVE[0] <= 1850)
    assert fit_drive_map(DRIVE[0][kept], DRIVE[1][kept], "line", neutral=1500.0).r_squared == pytest.approx(
        0.9837, abs=5e-5
    )
    assert fit_drive_map(*DRIVE, "cubic", neutral=1500.0).r_squared == pytest.approx(0.9917, abs=5e-5)
    assert fit_drive_map(*DRIVE, "line", neutral=1500.0).r_squared == pytest.approx(0.9234, abs=5e-5)


def test_better_maps_predict_left_out_commands_better_than_the_thesis_forms():
    for axle in ("front", "rear"):
        fits = compare_maps(CurvePoints.from_measurements(*steering(axle)), steering_fitters())
        assert fits["line_with_end_stops"].cross_validated_rms < fits["thesis"].cross_validated_rms / 4
    fits = compare_maps(CurvePoints.from_measurements(*DRIVE), drive_fitters(1500.0))
    for name in ("dead_band_with_saturation", "dead_band_with_saturation_refined"):
        assert fits[name].cross_validated_rms < 0.7 * fits["thesis"].cross_validated_rms
        assert fits[name].cross_validated_rms < 0.4 * fits["cubic"].cross_validated_rms


def test_standard_errors_of_a_line_are_those_of_its_residuals():
    rng = np.random.default_rng(1)
    slopes, errors = [], []
    for _ in range(300):
        fit = fit_steering_map(PULSES, -0.0015 * (PULSES - 1500) + 0.005 * rng.standard_normal(13), "line")
        slopes.append(fit.map.slope)
        errors.append(fit.stderr["slope"])
    assert np.mean(errors) == pytest.approx(np.std(slopes), rel=0.1)


@given(
    slope=st.sampled_from([-1.0, 1.0]).flatmap(lambda s: st.floats(0.0011, 0.0019).map(lambda v: s * v)),
    zero=st.floats(1450, 1550),
    low=st.floats(-0.75, -0.5),
    high=st.floats(0.5, 0.75),
)
@settings(max_examples=60, deadline=None)
def test_any_servo_between_stops_is_recovered(slope, zero, low, high):
    rng = np.random.default_rng(7)
    command = np.repeat(PULSES, 4)
    true = np.clip(slope * (command - zero), low, high)
    fit = fit_steering_map(command, true + 0.002 * rng.standard_normal(len(command)), "line_with_end_stops")
    fine = np.linspace(900, 2100, 200)
    assert np.max(np.abs(fit.map(fine) - np.clip(slope * (fine - zero), low, high))) < 0.02
    assert fit.map.slope == pytest.approx(slope, rel=0.03)


def test_a_servo_that_reaches_no_stop_ends_where_it_was_measured():
    fit = fit_steering_map(PULSES, 0.001 * (PULSES - 1500) + 1e-4 * np.sin(PULSES), "line_with_end_stops")
    assert fit.map.output_range == pytest.approx((-0.6, 0.6), abs=1e-3)
    assert not fit.left_out


def test_a_spoilt_command_is_left_out_and_said():
    angle = np.clip(-0.0015 * (PULSES - 1500), -0.7, 0.7) + 1e-3 * np.cos(PULSES)
    angle[5] += 0.3
    fit = fit_steering_map(PULSES, angle, "line_with_end_stops")
    assert [out.command for out in fit.left_out] == [1400.0]
    assert "off the map" in fit.left_out[0].why
    assert fit.map.slope == pytest.approx(-0.0015, rel=0.01)


def test_one_spoilt_repeat_of_three_does_not_matter():
    command = np.repeat(PULSES, 3)
    angle = np.clip(-0.0015 * (command - 1500), -0.7, 0.7)
    angle[4] += 1.0
    assert fit_steering_map(command, angle).map.slope == pytest.approx(-0.0015, rel=1e-6)


def dead_band(command, edges=(1470.0, 1540.0), ends=(1150.0, 1900.0), full=0.32, exponent=1.8):
    low = np.clip((edges[0] - command) / (edges[0] - ends[0]), 0, 1)
    high = np.clip((command - edges[1]) / (ends[1] - edges[1]), 0, 1)
    return full * ((1 - (1 - low) ** exponent) - (1 - (1 - high) ** exponent))


def test_a_dead_band_and_saturation_are_recovered():
    command = np.arange(900.0, 2101.0, 50.0)
    speed = dead_band(command) + 5e-4 * np.random.default_rng(2).standard_normal(25)
    fit = fit_drive_map(command, speed, "dead_band_with_saturation", neutral=1500.0)
    fine = np.linspace(900, 2100, 500)
    assert np.max(np.abs(fit.map(fine) - dead_band(fine))) < 0.006
    assert fit.map.low_edge == pytest.approx(1470, abs=4 * fit.stderr["low_edge"] + 2)
    assert fit.map.high_edge == pytest.approx(1540, abs=4 * fit.stderr["high_edge"] + 2)


def motor(command):
    """A drive of another form than any that is fitted: a chopped motor's hyperbola, cut off at full speed."""
    ahead = 1500.0 - np.asarray(command)
    y = np.maximum(np.abs(ahead) - np.where(ahead > 0, 29.0, 54.0), 0.0)
    return np.copysign(np.minimum(0.324, 0.49 * y / (y + 150.0)), ahead)


def test_a_map_refined_by_its_residuals_is_closest_to_a_drive_of_another_form():
    command, fine = np.arange(900.0, 2101.0, 50.0), np.arange(900.0, 2101.0, 7.0)
    rms = {}
    for kind in ("dead_band_with_saturation_refined", "dead_band_with_saturation", "monotone_table", "thesis"):
        fit = fit_drive_map(command, motor(command), kind, neutral=1500.0)
        rms[kind] = np.sqrt(np.mean((fit.map(fine) - motor(fine)) ** 2))
    assert rms["dead_band_with_saturation_refined"] == min(rms.values())
    assert rms["dead_band_with_saturation_refined"] < 0.002
    assert rms["thesis"] > 0.01
    chosen = fit_drive_map(command, motor(command), neutral=1500.0)
    assert chosen.name == "dead_band_with_saturation_refined"
    assert float(chosen.map(1500.0)) == 0.0
    assert chosen.map.inverse(0.16) == pytest.approx(1500 - 29 - 150 * 0.16 / 0.33, abs=1.0)


def test_a_drive_in_one_direction_gets_a_table():
    command = np.linspace(0.0, 0.4, 9)
    fit = fit_drive_map(command, 1.5 * np.maximum(command - 0.1, 0), neutral=0.0)
    assert fit.name == "monotone_table"
    with pytest.raises(FitError, match=r"too few commands below neutral for a dead band: 0 \(limit: at least 4\)"):
        fit_drive_map(command, command, "dead_band_with_saturation", neutral=0.0)


@given(st.lists(st.tuples(st.integers(900, 2100), st.floats(-1, 1)), max_size=30))
@example([(900, 1.0), (901, 0.0), (902, 0.0), (903, 1.1298916416127903e-308)])
@example([(900, 0.0), (901, 0.0), (902, 0.0), (903, 1.1298916416127903e-308)])
@settings(max_examples=80, deadline=None)
def test_any_measurements_give_maps_that_are_monotone_or_a_fit_error(pairs):
    command, value = [float(c) for c, _ in pairs], [v for _, v in pairs]
    fine = np.linspace(900, 2100, 300)
    for fit in (
        lambda: fit_steering_map(command, value, "line_with_end_stops"),
        lambda: fit_steering_map(command, value, "line_with_end_stops_refined"),
        lambda: fit_steering_map(command, value, "thesis"),
        lambda: fit_drive_map(command, value, "thesis", neutral=1500.0),
        lambda: fit_drive_map(command, value, "dead_band_with_saturation_refined", neutral=1500.0),
        lambda: fit_drive_map(command, value, "monotone_table", neutral=1500.0),
    ):
        try:
            steps = np.diff(fit().map(fine))
        except FitError:
            continue
        assert np.all(steps >= -1e-6) or np.all(steps <= 1e-6)


@pytest.mark.parametrize(
    ("command", "value", "kind", "message"),
    [
        ([], [], "line", "too few commands for a line: 0"),
        ([1500.0, 1500.0], [0.1, 0.2], "line", "too few commands for a line: 1"),
        ([1.0, 2.0, 3.0], [0.0, 0.1, 0.2], "line_with_end_stops", "too few commands for a line with end stops: 3"),
        (PULSES, np.zeros(13), "line_with_end_stops", "the output does not change with the command"),
        (PULSES, np.zeros(13), "monotone_table", "the output does not change with the command"),
        (PULSES, np.full(13, np.nan), "line", "too few commands for a line: 0"),
        ([1.0], [1.0, 2.0], "line", "two lists of equal length"),
    ],
)
def test_measurements_that_do_not_determine_a_map_are_one_clear_line(command, value, kind, message):
    with pytest.raises(FitError, match=message):
        fit_steering_map(command, value, kind)


def test_unknown_kind_is_an_input_error():
    with pytest.raises(InputError, match="unknown kind of fit: 'spline'"):
        fit_steering_map(PULSES, PULSES, "spline")
