"""From each residual of the thesis' own models to the effect behind it: before and after, held out.

"Held out" is a pulse, a mirrored pair, an interval or a trajectory that the model was not fitted to. The outermost
pulses are never left out: what lies beyond the others would be judged by extrapolation.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from agvbench.calibration import CurvePoints, MapFit, drive_fitters, steering_fitters
from agvbench.types import Floats
from agvbench.workflows.thesis.assumptions import Assumptions
from agvbench.workflows.thesis.battery import fit_droop, held_out_errors
from agvbench.workflows.thesis.chapter_8_effects import CAUSES, Checked, checks, null_error, predicted, rows_with
from agvbench.workflows.thesis.cornering import fit_loss, residual_of, samples, steering_measure
from agvbench.workflows.thesis.layout import Cell, Section, Table
from agvbench.workflows.thesis.lever_arm import IDLE, idle, slope_and_error
from agvbench.workflows.thesis.polynomial import fit_polynomial
from agvbench.workflows.thesis.scoring import CONDITIONS
from agvbench.workflows.thesis.tables import drive_table, endurance_table, rms, steering_table

NEUTRAL_US = 1500.0
PRINT_STEP_MPS = 0.01
_ROUNDING = 1000.0 * PRINT_STEP_MPS / math.sqrt(12.0)


@dataclass(frozen=True)
class Traced:
    """One residual and its effect.

    ``source`` where it is; ``before`` and ``after`` models in words; ``effect`` the library's name; ``size`` of it in
    words; ``left_out`` what was held out; ``at`` (n,) the places, in the unit of ``axis``; ``missed_before`` and
    ``missed_after`` (n,) held-out errors there, measured minus predicted, in ``unit``; ``floor`` what no model can
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
    missed_before: Floats
    missed_after: Floats
    floor: float
    unexplained: str

    @property
    def rms_before(self) -> float:
        """Held-out root mean square before."""
        return rms(self.missed_before)

    @property
    def rms_after(self) -> float:
        """Held-out root mean square after."""
        return rms(self.missed_after)


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
    index = np.arange(len(points))
    line = []
    for k in range(1, len(points) - 1):
        used = (index >= 1) & (index < len(points) - 1) & (index != k)  # the thesis drops one point at each end
        fit = fit_polynomial(points.command[used], points.value[used], 1)
        line.append(points.value[k] - float(fit(points.command[k])))
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
        1000.0 * after, _ROUNDING, "modes differ by more than printing; crab loses speed without turning",
    )  # fmt: skip


def kinematics_alone() -> float:
    """Return what eq. 5.6 without a loss misses of appendix B [mm/s]."""
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


@cache
def idle_errors() -> dict[str, tuple[Floats, Floats, Floats, Floats]]:
    """Return, per idle axle, held-out errors [deg]: of a constant, of a lever arm, of coupling; then the angle turned.

    Each pulse is predicted from the others. The lever arm's own offset of the axle is fitted beside it.
    """
    found = {}
    for axle in IDLE:
        part = idle(axle)
        every = np.arange(len(part.tangent))
        angle = np.arctan(part.tangent)
        rows = []
        for k in every[1:-1]:
            own = every != k
            constant = angle[own].mean()
            arm, _, _ = slope_and_error(part.curvature_per_m[own], part.tangent[own])
            level = part.tangent[own].mean() - arm * part.curvature_per_m[own].mean()
            lever = math.atan(level + arm * part.curvature_per_m[k])
            share, _, _ = slope_and_error(part.other_rad[own], angle[own])
            coupled = angle[own].mean() + share * (part.other_rad[k] - part.other_rad[own].mean())
            rows.append(np.degrees(angle[k] - np.array([constant, lever, coupled])))
        errors = np.array(rows).T
        found[axle] = errors[0], errors[1], errors[2], np.degrees(part.other_rad[1:-1])
    return found


def arm_across_tables() -> dict[str, tuple[float, float, float]]:
    """Return, per table, rms [deg] of its idle axle: about its mean, with the other table's arm, and its coupling.

    Only the axle's own mean is fitted to the table that is predicted. The coupling is carried over as it is.
    """
    parts = {axle: idle(axle) for axle in IDLE}
    out = {}
    for axle, other in zip(IDLE, reversed(IDLE), strict=True):
        own, known = parts[axle], parts[other]
        arm, _, _ = slope_and_error(known.curvature_per_m, known.tangent)
        share, _, _ = slope_and_error(known.other_rad, np.arctan(known.tangent))
        angle = np.arctan(own.tangent)
        lever = own.tangent - arm * own.curvature_per_m
        coupled = angle - share * own.other_rad
        out[axle] = (
            math.degrees(rms(angle - angle.mean())),
            math.degrees(rms(lever - lever.mean())),
            math.degrees(rms(coupled - coupled.mean())),
        )
    return out


def _idle(axle: str) -> Traced:
    constant, lever, _, other = idle_errors()[axle]
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


def residuals_section() -> Section:
    """Return residual, effect, before and after, for every table, and chapter 8's effects carried over."""
    columns: tuple[str, ...] = ("where", "before", "after", "effect", "size", "left out", "unit", "before, held out")
    columns += ("after, held out", "floor", "unexplained")
    rows = tuple(
        (
            t.source,
            t.before,
            t.after,
            t.effect,
            t.size,
            t.left_out,
            t.unit,
            t.rms_before,
            t.rms_after,
            t.floor,
            t.unexplained,
        )
        for t in traced()
    )
    narrow = ("where", "", "after", "effect", "size", "left out", "unit", "before", "held out", "floor", "")
    across = tuple((f"{a} axle", *values) for a, values in arm_across_tables().items())
    tables = (
        Table(
            "residuals", "From residual to effect", columns, rows,
            "Root mean squares of held-out errors; the floor of appendix B is its printed step of 10 mm/s.", narrow, 3,
        ),
        Table(
            "residuals_idle_axle", "The idle axle, each table predicted with the other's effect",
            ("idle axle", "its mean [deg]", "lever arm [deg]", "coupling [deg]"), across,
            "Only the axle's own mean is fitted to the table that is predicted.",
        ),
        _chapter_8_table(),
    )  # fmt: skip
    values: dict[str, Cell] = {f"{t.name}_before": t.rms_before for t in traced()}
    values |= {f"{t.name}_after": t.rms_after for t in traced()}
    values["kinematics_alone_mm_per_s"] = kinematics_alone()
    return Section("residuals", "From residual to effect, held out", _findings(), tables, values)


def _chapter_8_table() -> Table:
    plain = rows_with(None, 0.0)
    null = {c: null_error(r for r in plain if r.measured.condition == c) for c in CONDITIONS}
    columns: tuple[str, ...] = ("effect", "unit", "from uncalibrated", "from calibrated")
    columns += ("calibrated before", "after", "uncalibrated before", "after, back", "left out before", "left out after")
    columns += ("carries over",)
    rows = tuple(
        (
            k.cause.name, k.cause.unit, k.value["uncalibrated"], k.value["calibrated"], k.before["calibrated"],
            k.after["calibrated"], k.before["uncalibrated"], k.after["uncalibrated"], k.left_out_before,
            k.left_out_after, k.carries_over,
        )
        for k in checks()
    )  # fmt: skip
    note = (
        "Mean errors over the null's median error of their kind. Fitted to the rows of one condition, checked on the "
        f"other's; 'left out' is one trajectory at a time. The null scores {null['calibrated']:.2f} calibrated and "
        f"{null['uncalibrated']:.2f} uncalibrated."
    )
    return Table("residuals_chapter_8", "Chapter 8: one effect at a time, carried over", columns, rows, note, (), 3)


def asymmetry_with(checked: Checked) -> tuple[float, float, float]:
    """Return how much farther [mm] calibrated right turns miss than left ones: measured, plain, and with an effect.

    The effect has the value that the uncalibrated rows give it.
    """
    measured = {
        r.measured.trajectory: r.measured.median
        for r in rows_with(None, 0.0)
        if r.measured.condition == "calibrated" and r.measured.quantity == "delta_s_mm"
    }
    out = [measured]
    for cause, value in ((None, 0.0), (checked.cause, checked.value["uncalibrated"])):
        made = predicted(cause, value, "calibrated", Assumptions())
        out.append({p.trajectory.number: abs(p.delta_s_mm) for p in made})
    right_less_left = [0.5 * (d[6] + d[8] - d[5] - d[7]) for d in out]
    return right_less_left[0], right_less_left[1], right_less_left[2]


def _findings() -> tuple[str, ...]:
    better = [t for t in traced() if t.rms_after < t.rms_before]
    across = arm_across_tables()
    carried = [k for k in checks() if k.carries_over]
    plain = rows_with(None, 0.0)
    null = null_error(r for r in plain if r.measured.condition == "calibrated")
    best = min(k.after["calibrated"] for k in checks())
    by_name = {t.name: t for t in traced()}
    lines = [
        f"{len(better)} of {len(traced())} residuals shrink on what was left out: "
        + "; ".join(f"{t.source} {t.rms_before:.3g} → {t.rms_after:.3g} {t.unit}" for t in better)
        + ".",
        (
            f"Appendix B: eq. 5.6 alone leaves {kinematics_alone():.1f} mm/s. Printing to 10 mm/s would leave "
            f"{_ROUNDING:.1f}, which is {(_ROUNDING / by_name['cornering'].rms_after) ** 2:.0%} of the variance that "
            "the loss leaves: the rest is not explained."
        ),
        (
            "The idle axle: one table's lever arm, carried to the other, leaves "
            + " and ".join(f"{v[1]:.2f}° of {v[0]:.2f}° ({a})" for a, v in across.items())
            + ". One coupling for both servos fails (it leaves "
            + " and ".join(f"{v[2]:.2f}°" for v in across.values())
            + "); two couplings fit as well as the arm, but then no table can check the other."
        ),
        (
            f"Chapter 8: of {len(CAUSES)} effects, {len(carried)} help on the drives they were not fitted to, both "
            "ways and by trajectory"
            + (f" ({', '.join(k.cause.name for k in carried)})" if carried else "")
            + f". The best of all scores {best:.2f} on the calibrated rows, where 'it hits the target' scores "
            f"{null:.2f}: on medians of unsigned errors, and after trying {len(CAUSES)}, none is established. A "
            "constant curvature is also what a neutral that is off does: calibration, before it is a cause."
        ),
    ]
    for k in carried[:2]:
        measured, before, after = asymmetry_with(k)
        lines.append(
            f"Calibrated right turns miss by {measured:.0f} mm more than left ones; predicted {before:+.0f}, and "
            f"{after:+.0f} with {k.cause.name} at {k.value['uncalibrated']:.3g} {k.cause.unit}, the value of the "
            f"uncalibrated drives ({k.value['calibrated']:.3g} from the calibrated)."
        )
    return tuple(lines)
