"""Residuals of the thesis' own models, and the effect behind each: before and after, held out.

"Held out" is a pulse, a mirrored pair or an interval that the model was not fitted to. The outermost pulses are never
left out: what lies beyond the others would be judged by extrapolation.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from agvbench.calibration import CurvePoints, MapFit, drive_fitters, steering_fitters
from agvbench.thesis.added_effects import chapter_8_findings, chapter_8_table
from agvbench.thesis.refits.battery import fit_droop, held_out_errors
from agvbench.thesis.refits.cornering import fit_loss, residual_of, samples, steering_measure
from agvbench.thesis.refits.idle_axle import arm_across_tables, idle, idle_errors, slope_and_error
from agvbench.thesis.refits.polynomial import line_held_out_errors
from agvbench.thesis.section import Cell, ThesisSection, ThesisTable
from agvbench.thesis.tables import NEUTRAL_US, drive_table, endurance_table, rms, steering_table
from agvbench.types import Floats

PRINT_STEP_MPS = 0.01
ROUNDING_MM_PER_S = 1000.0 * PRINT_STEP_MPS / math.sqrt(12.0)
"""What printing speeds to 10 mm/s leaves of them, root mean square."""


@dataclass(frozen=True)
class Traced:
    """One residual and its effect.

    ``source`` where it is; ``before`` and ``after`` models in words; ``effect`` the library's name; ``size`` of it in
    words; ``left_out`` what was held out; ``at`` (n,) the places, in the unit of ``axis``; ``residual_before`` and
    ``residual_after`` (n,) held-out errors there, measured minus predicted, in ``unit``; ``floor`` what no model can
    remove, or NaN where the table does not say; ``unexplained`` in words.
    """

    name: str
    source: str
    before: str
    after: str
    effect: str
    size: str
    left_out: str
    axis: str
    unit: str
    at: Floats
    residual_before: Floats
    residual_after: Floats
    floor: float
    unexplained: str

    @property
    def rms_before(self) -> float:
        """Held-out root mean square before."""
        return rms(self.residual_before)

    @property
    def rms_after(self) -> float:
        """Held-out root mean square after."""
        return rms(self.residual_after)


def _left_out(points: CurvePoints, fitter: Callable[[CurvePoints], MapFit]) -> Floats:
    every = np.arange(len(points))
    errors = [
        points.value[k] - float(fitter(points.select(every != k)).map(points.command[k]))
        for k in range(1, len(points) - 1)
    ]
    return np.array(errors, dtype=np.float64)


def _steering(axle: str) -> Traced:
    table = steering_table(axle)
    points = CurvePoints.from_measurements(table.pulse_us, np.radians(table.median_deg))
    stops = steering_fitters()["line_with_end_stops"]
    line = line_held_out_errors(points.command, points.value, dropped=1)  # as the thesis does
    after = _left_out(points, stops)
    low, high = np.degrees(stops(points).map.output_range)
    number = "7.1" if axle == "front" else "7.2"
    return Traced(
        f"steering_{axle}", f"table {number}", "line, one point dropped at each end", "line with end stops",
        "steering_saturation (in the map)", f"stops at {low:.1f}° and {high:.1f}°", "a pulse", "steering pulse [µs]",
        "deg", points.command[1:-1], np.degrees(line), np.degrees(after), math.nan,
        "where a stop begins, between two pulses 100 µs apart, and how soft it is",
    )  # fmt: skip


def _drive() -> Traced:
    points = CurvePoints.from_measurements(*drive_table())
    fitters = drive_fitters(NEUTRAL_US)
    before, after = (1000.0 * _left_out(points, fitters[kind]) for kind in ("thesis", "dead_band_with_saturation"))
    table = fitters["dead_band_with_saturation"](points).map.to_toml()
    size = (
        f"still from {table['low_edge']:.0f} to {table['high_edge']:.0f} µs, full at {table['low_saturation']:.0f} and "
        f"{table['high_saturation']:.0f} µs"
    )
    return Traced(
        "drive", "table 7.4", "cubic on 1200…1850 µs", "dead band with saturation", "drive_dead_band (in the map)",
        size, "a pulse", "drive pulse [µs]", "mm/s", points.command[1:-1], before, after, math.nan,
        "forward and backward curves differ by more than one form with few numbers holds",
    )  # fmt: skip


def _cornering() -> Traced:
    s = samples()
    constant = 1000.0 * (s.speed_mps - s.straight_mps)
    after = np.empty_like(s.speed_mps)
    for pair in np.unique(s.pair_us):
        out = s.pair_us == pair
        after[out] = residual_of(steering_measure, fit_loss(steering_measure, ~out))[out]
    loss = fit_loss(steering_measure)
    measure = np.abs(np.degrees(s.front_rad)) + np.abs(np.degrees(s.rear_rad))
    return Traced(
        "cornering", "appendix B", "speed does not depend on steering", "eq. 5.6 and a loss", "cornering_speed_loss",
        f"loss {loss:.3f}", "a pair of mirrored pulses", "|δf| + |δr| [deg]", "mm/s", measure, constant,
        1000.0 * after, ROUNDING_MM_PER_S, "modes differ by more than printing; crab loses speed without turning",
    )  # fmt: skip


def kinematics_alone() -> float:
    """Return the rms residual of eq. 5.6 without a loss in appendix B [mm/s]."""
    return 1000.0 * rms(residual_of(steering_measure, 0.0))


def _battery() -> Traced:
    start_s, speed = endurance_table()
    constant, line = held_out_errors()
    droop = fit_droop(start_s / 3600.0, speed)
    return Traced(
        "battery", "table 8.2", "constant speed", "linear droop", "battery_droop",
        f"per_hour {droop.per_hour:.4f} 1/h", "an interval", "time [h]", "mm/s", start_s / 3600.0,
        1000.0 * constant, 1000.0 * line, math.nan, "eleven means say nothing of one drive, nor of a charge",
    )  # fmt: skip


def _idle(axle: str) -> Traced:
    constant, lever, other = idle_errors()[axle]
    part = idle(axle)
    arm, error, _ = slope_and_error(part.curvature_per_m, part.tangent)
    number = "7.1, rear" if axle == "rear" else "7.2, front"
    return Traced(
        f"idle_{axle}", f"table {number} axle", "an axle at 1500 µs stands still", "lever arm of the centroid",
        "marker_offset (or axle_coupling)", f"forward_m {arm:.4f} ± {error:.4f} m", "a pulse",
        "other axle [deg]", "deg", other, constant, lever, math.nan,
        "a lever arm or coupling: within one table both fit alike",
    )  # fmt: skip


@cache
def traced() -> tuple[Traced, ...]:
    """Return every residual that a table holds pulse by pulse; chapter 8 is `checks`."""
    return (_steering("front"), _steering("rear"), _drive(), _cornering(), _battery(), _idle("rear"), _idle("front"))


def residuals_section() -> ThesisSection:
    """Return residual, effect, before and after, for every table, and chapter 8's effects carried over."""
    values: dict[str, Cell] = {f"{t.name}_before": t.rms_before for t in traced()}
    values |= {f"{t.name}_after": t.rms_after for t in traced()}
    values["kinematics_alone_mm_per_s"] = kinematics_alone()
    findings = (_shrinking(), _appendix_b(), _idle_axle(), *chapter_8_findings())
    tables = (_residual_table(), _idle_table(), chapter_8_table())
    return ThesisSection("residuals", "From residual to effect, held out", findings, tables, values)


def _residual_table() -> ThesisTable:
    columns: tuple[str, ...] = ("where", "before", "after", "effect", "size", "left out", "unit", "before, held out")
    columns += ("after, held out", "floor", "unexplained")
    rows = tuple(
        (
            t.source, t.before, t.after, t.effect, t.size, t.left_out, t.unit, t.rms_before, t.rms_after, t.floor,
            t.unexplained,
        )
        for t in traced()
    )  # fmt: skip
    narrow = ("where", "", "after", "effect", "size", "left out", "unit", "before", "held out", "floor", "")
    note = "Root mean squares of held-out errors; the floor of appendix B is its printed step of 10 mm/s."
    return ThesisTable("residuals", "From residual to effect", columns, rows, note, narrow, 3)


def _idle_table() -> ThesisTable:
    return ThesisTable(
        "residuals_idle_axle", "The idle axle, each table predicted with the other's effect",
        ("idle axle", "its mean [deg]", "lever arm [deg]", "coupling [deg]"),
        tuple((f"{a} axle", *values) for a, values in arm_across_tables().items()),
        "Only the axle's own mean is fitted to the table that is predicted.",
    )  # fmt: skip


def _shrinking() -> str:
    better = [t for t in traced() if t.rms_after < t.rms_before]
    each = "; ".join(f"{t.source} {t.rms_before:.3g} → {t.rms_after:.3g} {t.unit}" for t in better)
    return f"{len(better)} of {len(traced())} residuals shrink on what was left out: {each}."


def _appendix_b() -> str:
    cornering = next(t for t in traced() if t.name == "cornering")
    return (
        f"Appendix B: eq. 5.6 alone leaves {kinematics_alone():.1f} mm/s. Printing to 10 mm/s would leave "
        f"{ROUNDING_MM_PER_S:.1f}, which is {(ROUNDING_MM_PER_S / cornering.rms_after) ** 2:.0%} of the variance that "
        "the loss leaves: the rest is not explained."
    )


def _idle_axle() -> str:
    across = arm_across_tables()
    arm = " and ".join(f"{v[1]:.2f}° of {v[0]:.2f}° ({a})" for a, v in across.items())
    coupling = " and ".join(f"{v[2]:.2f}°" for v in across.values())
    return (
        f"The idle axle: one table's lever arm, carried to the other, leaves {arm}. One coupling for both servos fails "
        f"(it leaves {coupling}); two couplings fit as well as the arm, but then no table can check the other."
    )
