"""Tables 7.1 and 7.2: the lines of eq. 7.1 and 7.2 refitted, and what the axles really do."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from agvbench.model import thesis_vehicle
from agvbench.thesis.refits.polynomial import Polynomial, fit_polynomial
from agvbench.thesis.section import Figure, ThesisSection, ThesisTable, figures_table
from agvbench.thesis.tables import STATISTICS, steering_table, verification_table
from agvbench.types import Floats
from agvbench.vehicle.maps import Line, MonotoneTable, StaticMap

AXLES = ("front", "rear")
#: eq. 7.1 and 7.2 as printed: slope [deg/µs], intercept [deg], R² of table 7.5.
PRINTED = {"front": ("-0.0840", "125.00", "0.9991"), "rear": ("-0.0837", "123.55", "0.9954")}
EQUATION = {"front": "eq. 7.1", "rear": "eq. 7.2"}


def refit_line(axle: str, dropped: int, statistic: str = "median") -> Polynomial:
    """Return the line [deg against µs] with `dropped` points left out at each end."""
    table = steering_table(axle)
    kept = slice(dropped, len(table.pulse_us) - dropped)
    return fit_polynomial(table.pulse_us[kept], table.angle_deg[statistic][kept], 1)


def _line(slope_deg: float, intercept_deg: float) -> Line:
    return Line(math.radians(slope_deg), math.radians(intercept_deg))


@cache
def published_lines() -> tuple[Line, Line]:
    """Return eq. 7.1 and 7.2 as printed, in rad per µs."""
    return tuple(_line(float(PRINTED[a][0]), float(PRINTED[a][1])) for a in AXLES)  # type: ignore[return-value]


@cache
def unrounded_lines() -> tuple[Line, Line]:
    """Return the same lines before they were rounded: one point dropped at each end."""
    return tuple(_line(*refit_line(a, 1).coefficients) for a in AXLES)  # type: ignore[return-value]


@cache
def true_maps(kind: str) -> tuple[StaticMap, StaticMap]:
    """Return what the front and rear axle do in chapter 7, in rad.

    ``"end_stops"``: the shipped vehicle's lines with end stops; ``"monotone"``: the medians themselves, interpolated.
    """
    if kind == "end_stops":
        return thesis_vehicle().front, thesis_vehicle().rear
    tables = (steering_table(axle) for axle in AXLES)
    return tuple(interpolated(t.pulse_us, np.radians(t.median_deg)) for t in tables)  # type: ignore[return-value]


def interpolated(pulse_us: Floats, angle_rad: Floats) -> MonotoneTable:
    """Return the points themselves, joined monotonically."""
    return MonotoneTable(tuple(pulse_us.tolist()), tuple(angle_rad.tolist()))


@cache
def verification_maps() -> tuple[StaticMap, StaticMap]:
    """Return table 6.1's axles, interpolated: the same vehicle before chapter 7."""
    pulse, front, rear = verification_table()
    return interpolated(pulse, np.radians(front)), interpolated(pulse, np.radians(rear))


def _line_rows(axle: str) -> list[tuple[str, int, str, float, float, float, float]]:
    fits = [(dropped, "median") for dropped in (0, 1, 2, 3)] + [(1, s) for s in STATISTICS if s != "median"]
    rows = []
    for dropped, statistic in fits:
        line = refit_line(axle, dropped, statistic)
        slope, intercept = line.coefficients
        rows.append((axle, dropped, statistic, slope, intercept, -intercept / slope, line.r_squared))
    return rows


def _figures(axle: str) -> list[Figure]:
    line, where = refit_line(axle, 1), EQUATION[axle]
    slope, intercept, r_squared = PRINTED[axle]
    spread = _largest_spread(axle)
    saturated = f"saturated points are in the fit: {refit_line(axle, 2).coefficients[0]:.4f} with two dropped"
    return [
        Figure(f"{axle} slope [deg/µs]", where, slope, line.coefficients[0], saturated),
        Figure(f"{axle} intercept [deg]", where, intercept, line.coefficients[1], "one point dropped at each end"),
        Figure(f"{axle} R²", "table 7.5", r_squared, line.r_squared, "one point dropped at each end"),
        Figure(f"{axle} largest spread about the median [deg]", "7.2", {"front": "0.46", "rear": "0.94"}[axle], spread),
    ]


def _largest_spread(axle: str) -> float:
    angles = steering_table(axle).angle_deg
    return float(max(np.max(angles["median"] - angles["min"]), np.max(angles["max"] - angles["median"])))


def neutral_error_deg(axle: str) -> float:
    """Return where the axle really points [deg] when the published line is asked for straight ahead."""
    index = AXLES.index(axle)
    pulse = published_lines()[index].inverse(0.0)
    return math.degrees(float(true_maps("end_stops")[index](pulse)))


def steering_section() -> ThesisSection:
    """Return the refit of tables 7.1 and 7.2."""
    two = {axle: refit_line(axle, 2) for axle in AXLES}
    rows = [row for axle in AXLES for row in _line_rows(axle)]
    columns = ("axle", "dropped at each end", "statistic", "slope [deg/µs]", "intercept [deg]", "zero [µs]", "R²")
    errors = {axle: neutral_error_deg(axle) for axle in AXLES}
    findings = (
        (
            "Eq. 7.1, 7.2 and their R² come back to every printed digit from the medians with one point dropped at "
            "each end."
        ),
        "That leaves saturated points (1000 and 2000 µs) in the fit and flattens the lines. Two dropped give "
        + ", ".join(f"{a} {two[a].coefficients[0]:.4f} deg/µs (R² {two[a].r_squared:.4f})" for a in AXLES)
        + f": the printed slopes are {_percent(two, 'front'):.1f} % and {_percent(two, 'rear'):.1f} % too small.",
        (
            f"Asked for straight ahead, the printed lines leave the front axle at {errors['front']:+.2f}° and the "
            f"rear at {errors['rear']:+.2f}°: the calibrated vehicle does not drive straight."
        ),
    )
    tables = (
        figures_table("steering", "Steering lines, as printed and refitted", [f for a in AXLES for f in _figures(a)]),
        ThesisTable("steering_lines", "Lines by points dropped and by statistic", columns, tuple(rows), digits=5),
    )
    names = ("slope_deg_per_us", "intercept_deg")
    values = {f"{a}_{k}": v for a in AXLES for k, v in zip(names, two[a].coefficients, strict=True)}
    return ThesisSection("steering", "Steering (tables 7.1, 7.2, eq. 7.1, 7.2)", findings, tables, dict(values))


def _percent(two: dict[str, Polynomial], axle: str) -> float:
    return 100.0 * (1.0 - float(PRINTED[axle][0]) / two[axle].coefficients[0])
