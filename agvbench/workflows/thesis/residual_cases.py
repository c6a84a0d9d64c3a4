"""Each residual of the thesis' own models that a table holds pulse by pulse, and the effect behind it, held out.

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
from agvbench.types import Floats
from agvbench.workflows.thesis.battery import fit_droop, held_out_errors
from agvbench.workflows.thesis.cornering import NEUTRAL_US, fit_loss, residual_of, samples, steering_measure
from agvbench.workflows.thesis.idle_axle import idle_errors
from agvbench.workflows.thesis.lever_arm import idle, slope_and_error
from agvbench.workflows.thesis.polynomial import fit_polynomial
from agvbench.workflows.thesis.tables import drive_table, endurance_table, rms, steering_table

PRINT_STEP_MPS = 0.01
ROUNDING_MM_PER_S = 1000.0 * PRINT_STEP_MPS / math.sqrt(12.0)
"""What printing speeds to 10 mm/s leaves of them, root mean square."""


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
        1000.0 * after, ROUNDING_MM_PER_S, "modes differ by more than printing; crab loses speed without turning",
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
