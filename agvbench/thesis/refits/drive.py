"""Table 7.4: line and cubic refitted, the printed eq. 7.3, and the measured speeds themselves."""

from __future__ import annotations

from functools import cache

import numpy as np

from agvbench.calibration import fit_drive_map
from agvbench.thesis.refits.polynomial import Polynomial, fit_polynomial
from agvbench.thesis.section import Figure, ThesisSection, ThesisTable, figures_table
from agvbench.thesis.tables import drive_table
from agvbench.vehicle.maps import Cubic, StaticMap

PARTIAL_US = (1200.0, 1850.0)
FULL_US = (900.0, 2100.0)
#: eq. 7.3 as printed, from the cube down.
PRINTED_CUBIC = ("3.74e-9", "-1.70e-5", "0.024", "-10.86")
PRINTED_R_SQUARED = {
    (1, FULL_US): "0.9234",
    (3, FULL_US): "0.9917",
    (1, PARTIAL_US): "0.9837",
    (3, PARTIAL_US): "0.9949",
}


def refit_drive(order: int, span_us: tuple[float, float]) -> Polynomial:
    """Return the polynomial through table 7.4 between two pulses, both included."""
    pulse, speed = drive_table()
    kept = (pulse >= span_us[0]) & (pulse <= span_us[1])
    return fit_polynomial(pulse[kept], speed[kept], order)


def printed_cubic(pulse_us: float) -> float:
    """Return eq. 7.3 as printed [m/s]."""
    return float(np.polyval([float(c) for c in PRINTED_CUBIC], pulse_us))


@cache
def cubic_map() -> Cubic:
    """Return the refitted eq. 7.3 on all of its falling branch, so that ±0.32 m/s is on it."""
    a, b, c, d = refit_drive(3, PARTIAL_US).coefficients
    turns = sorted(np.roots([3.0 * a, 2.0 * b, c]).real)
    return Cubic(a, b, c, d, float(np.ceil(turns[0])), float(np.floor(turns[1])))


@cache
def dead_band_map() -> StaticMap:
    """Return the dead band with saturation fitted to table 7.4 [m/s]."""
    return fit_drive_map(*drive_table(), kind="dead_band_with_saturation", neutral=1500.0).map


def table_speed(pulse_us: float) -> float:
    """Return table 7.4's speed [m/s] at any pulse, interpolated between its 50 µs steps."""
    return float(np.interp(pulse_us, *drive_table()))


def _figures() -> list[Figure]:
    names = {1: "line", 3: "cubic"}
    spans = {FULL_US: "full", PARTIAL_US: "partial, 1200…1850 µs"}
    figures = [
        Figure(f"R² of the {names[order]}, {spans[span]}", "table 7.5", printed, refit_drive(order, span).r_squared)
        for (order, span), printed in PRINTED_R_SQUARED.items()
    ]
    refit = refit_drive(3, PARTIAL_US).coefficients
    powers = ("pw³", "pw²", "pw", "1")
    lost = f"rounded too far: v(1500 µs) = {printed_cubic(1500.0):.2f} m/s as printed"
    figures += [
        Figure(f"coefficient of {power}", "eq. 7.3", printed, value, lost)
        for power, printed, value in zip(powers, PRINTED_CUBIC, refit, strict=True)
    ]
    return figures


def _rounding_rows() -> tuple[tuple[float, float, float, float], ...]:
    cubic = refit_drive(3, PARTIAL_US)
    return tuple(
        (pulse, table_speed(pulse), float(cubic(pulse)), printed_cubic(pulse))
        for pulse in (1200.0, 1400.0, 1500.0, 1600.0, 1850.0)
    )


def half_speed_errors() -> dict[float, float]:
    """Return the error of the cubic against table 7.4 [%] at the pulses about half the full speed."""
    cubic = refit_drive(3, PARTIAL_US)
    return {p: 100.0 * (float(cubic(p)) / table_speed(p) - 1.0) for p in (1350.0, 1400.0, 1650.0)}


def drive_section() -> ThesisSection:
    """Return the refit of table 7.4."""
    errors = half_speed_errors()
    findings = (
        "All four R² of table 7.5 come back from table 7.4; 'partial' is 1200…1850 µs, 14 points.",
        (
            f"Eq. 7.3 cannot be used as printed: its rounding leaves v(1500 µs) = {printed_cubic(1500.0):.2f} m/s. "
            f"The coefficient of pw, printed 0.024, must be {refit_drive(3, PARTIAL_US).coefficients[2]:.7f} (one "
            "unit of its last digit moves v by 1.5 m/s)."
        ),
        "About half speed the cubic is low: "
        + ", ".join(f"{e:+.1f} % at {p:.0f} µs" for p, e in errors.items())
        + f"; at 1550 µs, where the vehicle all but stands ({table_speed(1550.0):.3f} m/s), it says "
        + f"{float(refit_drive(3, PARTIAL_US)(1550.0)):.3f}.",
    )
    columns = ("pulse [µs]", "table 7.4 [m/s]", "refitted cubic [m/s]", "eq. 7.3 as printed [m/s]")
    tables = (
        figures_table("drive", "Drive curve, as printed and refitted", _figures()),
        ThesisTable("drive_rounding", "What the rounding of eq. 7.3 does", columns, _rounding_rows()),
    )
    names = ("cubic", "quadratic", "linear", "constant")
    values = dict(zip(names, refit_drive(3, PARTIAL_US).coefficients, strict=True))
    return ThesisSection("drive", "Drive (table 7.4, eq. 7.3, table 7.5)", findings, tables, dict(values))
