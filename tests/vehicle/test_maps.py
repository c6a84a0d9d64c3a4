"""What is special about each kind of static map, against formulas written out here."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agvbench.errors import VehicleError
from agvbench.vehicle.maps import (
    Cubic,
    DeadBandWithSaturation,
    Fixed,
    FullSpeedOrStop,
    Line,
    LineWithEndStops,
    MonotoneTable,
)
from agvbench.vehicle.maps.solve import solve_monotone


def test_line_matches_equation_7_1_between_its_limits() -> None:
    front = Line(math.radians(-0.0840), math.radians(125.0), 900.0, 2100.0)
    assert math.degrees(float(front(1200.0))) == pytest.approx(125.0 - 0.0840 * 1200.0)
    assert float(front(500.0)) == float(front(900.0))
    assert Line.through(1500.0, -0.001, command_low=900.0, command_high=2100.0)(1500.0) == pytest.approx(0.0, abs=1e-15)


def test_end_stop_is_reached_at_the_corner_and_inverted_to_it() -> None:
    servo = LineWithEndStops(-0.0015, 2.25, -0.70, 0.69)
    corner = (2.25 - 0.69) / 0.0015
    assert float(servo(corner - 1.0)) == 0.69
    assert float(servo(corner + 1.0)) == pytest.approx(0.69 - 0.0015)
    assert float(servo.inverse(0.69)) == pytest.approx(corner)
    assert float(servo.inverse(0.69 + 1e-10)) == pytest.approx(corner)


def test_dead_band_inverts_to_its_centre_and_saturation_to_its_corner() -> None:
    drive = DeadBandWithSaturation(1200.0, 1480.0, 1540.0, 1840.0, 0.32, -0.30, 2.0, 1.0)
    assert np.all(drive([1480.0, 1500.0, 1540.0]) == 0.0)
    assert drive.inverse([0.0, 0.32, -0.30]).tolist() == pytest.approx([1510.0, 1200.0, 1840.0])
    # Half way up a parabola that flattens: 1 − (1 − 1/2)².
    assert float(drive(1340.0)) == pytest.approx(0.32 * 0.75)
    assert float(drive(1690.0)) == pytest.approx(-0.15)


def test_table_passes_through_its_points_and_inverts_flat_stretches() -> None:
    points = ((900.0, 1200.0, 1400.0, 1480.0, 1540.0, 1800.0, 2100.0), (0.32, 0.32, 0.16, 0.0, 0.0, -0.3, -0.3))
    for interpolation in ("pchip", "linear"):
        drive = MonotoneTable(*points, interpolation)
        assert drive(points[0]).tolist() == pytest.approx(points[1], abs=1e-15)
        assert drive.inverse([0.32, 0.16, 0.0, -0.3]).tolist() == pytest.approx([1200.0, 1400.0, 1510.0, 1800.0])
    assert float(MonotoneTable(*points, "linear")(1300.0)) == pytest.approx(0.24)


def test_cubic_agrees_with_polyval_and_its_inverse_with_the_roots() -> None:
    coefficients = (3.7419e-9, -1.69804e-5, 2.43017e-2, -10.85699)
    drive = Cubic(*coefficients, 1200.0, 1850.0)
    commands = np.linspace(1200.0, 1850.0, 7)
    np.testing.assert_allclose(drive(commands), np.polyval(coefficients, commands), atol=1e-14)
    roots = np.roots(np.subtract(coefficients, (0.0, 0.0, 0.0, 0.16)))
    branch = roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 1200.0) & (roots.real < 1850.0)].real
    assert len(branch) == 1
    assert float(drive.inverse(0.16)) == pytest.approx(branch[0], abs=1e-6)


def test_full_speed_or_stop_knows_three_speeds() -> None:
    drive = FullSpeedOrStop(900.0, 1500.0, 2100.0, 0.32, -0.32)
    assert drive.inverse([0.32, 0.0, -0.32]).tolist() == [900.0, 1500.0, 2100.0]
    with pytest.raises(VehicleError, match=r"no command is known for this output: 0\.16"):
        drive.inverse([0.32, 0.16])


def test_fixed_sends_neutral() -> None:
    assert float(Fixed(command=1500.0).inverse(0.0)) == 1500.0
    with pytest.raises(VehicleError, match=r"output is out of the map's range: 0\.1"):
        Fixed().inverse(0.1)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Line(math.nan, 0.0), "slope: must be a finite number"),
        (lambda: Line(math.inf, 0.0), "slope: must be a finite number"),
        (lambda: Line("fast", 0.0), "slope: must be a number: 'fast'"),  # type: ignore[arg-type]
        (lambda: Line(1.0, 0.0, 2.0, 1.0), "command_high: is too low: 1.0"),
        (lambda: LineWithEndStops(0.0, 0.0), "slope: a line without slope"),
        (lambda: LineWithEndStops(1.0, 0.0, 0.5, 0.5), "output_high: is too low"),
        (lambda: Cubic(1.0, 0.0, -0.1, 0.0, -1.0, 1.0), "the cubic turns around"),
        (lambda: Cubic(0.0, 0.0, 0.0, 1.0, -1.0, 1.0), "the cubic turns around"),
        (lambda: DeadBandWithSaturation(0.0, 2.0, 1.0, 3.0, 1.0, -1.0), "high_edge: is too low"),
        (lambda: DeadBandWithSaturation(0.0, 1.0, 1.0, 3.0, 1.0, 1.0), "opposite signs"),
        (lambda: DeadBandWithSaturation(0.0, 1.0, 1.0, 3.0, 1.0, -1.0, 0.5), "low_exponent: exponent is too small"),
        (lambda: FullSpeedOrStop(0.0, 1.0, 2.0, 1.0, 1.0), "opposite signs"),
        (lambda: MonotoneTable((0.0, 1.0), (0.0, 1.0, 2.0)), "equally many: 2 and 3"),
        (lambda: MonotoneTable((0.0,), (0.0,)), "a table needs more points: 1"),
        (lambda: MonotoneTable((0.0, 0.0), (0.0, 1.0)), "commands must ascend"),
        (lambda: MonotoneTable((0.0, 1.0, 2.0), (0.0, 1.0, 0.5)), "ascend or descend throughout"),
        (lambda: MonotoneTable((0.0, 1.0), (1.0, 1.0)), "ascend or descend throughout"),
        (lambda: MonotoneTable((0.0, 1.0), (0.0, math.nan)), "outputs: must be a list of finite numbers"),
        (lambda: MonotoneTable((0.0, 1.0), (0.0, 1.0), "spline"), "unknown interpolation: spline"),
    ],
)
def test_values_that_make_no_map_are_refused(build: object, message: str) -> None:
    with pytest.raises(VehicleError, match=message):
        build()  # type: ignore[operator]


@given(st.floats(-8.0, 8.0), st.sampled_from((1.0, -1.0)))
def test_solver_copes_with_a_vanishing_slope(target: float, sign: float) -> None:
    wanted = np.array([target])
    solved = solve_monotone(
        lambda x: sign * x**3, lambda x: sign * 3.0 * x**2, wanted, np.array([-2.0]), np.array([2.0])
    )
    assert float(solved[0]) == pytest.approx(math.copysign(abs(target) ** (1.0 / 3.0), sign * target), abs=1e-7)
