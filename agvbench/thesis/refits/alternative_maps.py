"""Alternative maps, beside the thesis' own forms, judged on pulses they have not seen.

Each map is fitted without one pulse and asked for it, for every pulse but the outermost two, which only
extrapolation could give (`agvbench.calibration.compare_maps`).
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np

from agvbench.calibration import CurvePoints, MapFit, compare_maps, drive_fitters, steering_fitters
from agvbench.errors import FitError
from agvbench.thesis.refits.polynomial import line_held_out_errors
from agvbench.thesis.refits.steering import AXLES
from agvbench.thesis.section import Cell, ThesisSection, ThesisTable
from agvbench.thesis.tables import NEUTRAL_US, drive_table, rms, steering_table

#: What a fit is called in the tables; fits of other names are the calibration's own variants.
NAMES = {
    "thesis": "thesis: end points dropped",
    "line": "line through all points",
    "cubic": "cubic through all points",
    "line_with_end_stops": "line with end stops",
    "line_with_end_stops_refined": "line with end stops, refined",
    "dead_band_with_saturation": "dead band with saturation",
    "dead_band_with_saturation_refined": "dead band with saturation, refined",
    "monotone_table": "monotone table",
}
Fits = dict[str, MapFit | FitError]


@cache
def steering_fits(axle: str) -> Fits:
    """Return every kind of map fitted to one axle's medians [rad against µs], cross-validated."""
    table = steering_table(axle)
    points = CurvePoints.from_measurements(table.pulse_us, np.radians(table.median_deg))
    fits = compare_maps(points, steering_fitters())
    for name, dropped in (("line", 0), ("thesis", 1)):
        if isinstance(fit := fits[name], MapFit):
            # A `Line` map stays put beyond its last command; eq. 7.1 does not, and is judged as it is written.
            errors_deg = line_held_out_errors(table.pulse_us, table.median_deg, dropped)
            fits[name] = replace(fit, cross_validated_rms=math.radians(rms(errors_deg)))
    return fits


@cache
def drive_fits() -> Fits:
    """Return every kind of map fitted to table 7.4 [m/s against µs], cross-validated."""
    return compare_maps(CurvePoints.from_measurements(*drive_table()), drive_fitters(NEUTRAL_US))


def _rows(what: str, fits: Fits, unit: float) -> list[tuple[Cell, ...]]:
    rows: list[tuple[Cell, ...]] = []
    for name, fit in fits.items():
        if isinstance(fit, MapFit):
            numbers = (_clean(unit * fit.residual_sd), _clean(unit * fit.rms_all), unit * fit.cross_validated_rms)
            rows.append((what, NAMES.get(name, name), len(fit.left_out), fit.r_squared, *numbers))
    return sorted(rows, key=lambda row: float(row[-1] or 0.0), reverse=True)


def _clean(error: float) -> float:
    """Return an error without the rounding of exact interpolation."""
    return 0.0 if error < 1e-9 else error


def _table(name: str, title: str, unit: str, rows: list[tuple[Cell, ...]]) -> ThesisTable:
    columns = ("what", "map", "left out", "R²", f"residual sd [{unit}]", f"rms, all pulses [{unit}]")
    note = "R² and residual sd over the points used; R² of a monotone table is 1 by construction and says nothing."
    return ThesisTable(name, title, (*columns, f"held-out rms [{unit}]"), tuple(rows), note)


def held_out(fits: Fits, name: str) -> float:
    """Return the held-out rms of one fit, in the unit of its map."""
    fit = fits[name]
    return fit.cross_validated_rms if isinstance(fit, MapFit) else math.nan


def maps_section() -> ThesisSection:
    """Return the better maps beside the thesis' forms."""
    steering = [row for axle in AXLES for row in _rows(axle, steering_fits(axle), math.degrees(1.0))]
    drive = _rows("drive", drive_fits(), 1000.0)
    stops = {a: math.degrees(held_out(steering_fits(a), "line_with_end_stops")) for a in AXLES}
    printed = {a: math.degrees(held_out(steering_fits(a), "thesis")) for a in AXLES}
    band, cubic, table = (
        1000.0 * held_out(drive_fits(), n) for n in ("dead_band_with_saturation", "thesis", "monotone_table")
    )
    findings = (
        "A pulse left out of the fit is predicted by a line with end stops to "
        + " and ".join(f"{stops[a]:.2f}° ({a})" for a in AXLES)
        + ", by the thesis' line to "
        + " and ".join(f"{printed[a]:.2f}°" for a in AXLES)
        + ".",
        (
            f"Table 7.4: a dead band with saturation predicts a left-out pulse to {band:.1f} mm/s, the thesis' cubic "
            f"to {cubic:.1f}, the measured curve itself, interpolated, to {table:.1f}."
        ),
    )
    tables = (
        _table("maps_steering", "Steering maps on pulses they have not seen", "deg", steering),
        _table("maps_drive", "Drive maps on pulses they have not seen", "mm/s", drive),
    )
    values: dict[str, Cell] = {f"{a}_end_stops_held_out_deg": stops[a] for a in AXLES}
    values |= {f"{a}_thesis_held_out_deg": printed[a] for a in AXLES}
    values |= {"drive_dead_band_held_out_mm_per_s": band, "drive_thesis_held_out_mm_per_s": cubic}
    return ThesisSection("maps", "Better maps (tables 7.1, 7.2, 7.4)", findings, tables, values)
