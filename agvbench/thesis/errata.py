"""What the thesis prints that its own tables, text or geometry contradict, each shown by a number."""

from __future__ import annotations

import math

import numpy as np

from agvbench.thesis.prediction.end_pose import ACCELERATION_MPS2, BRAKING_MPS2, driven_distance
from agvbench.thesis.prediction.scoring import CONDITIONS
from agvbench.thesis.refits.battery import ENDURANCE_S
from agvbench.thesis.refits.cornering import count_mirrored
from agvbench.thesis.refits.drive import half_speed_errors, printed_cubic
from agvbench.thesis.refits.idle_axle import common_lever_arm
from agvbench.thesis.refits.polynomial import fit_polynomial
from agvbench.thesis.refits.steering import refit_line
from agvbench.thesis.section import Cell, Figure, ThesisSection, ThesisTable, figures_table
from agvbench.thesis.tables import (
    GEOMETRY,
    MeasuredRow,
    cornering_table,
    end_pose_rows,
    endurance_table,
    idle_axle_table,
    steering_table,
    verification_table,
)
from agvbench.vehicle.kinematics import body_motion

_FULL_SPEED_MPS = 0.32


def printed_speed(front_rad: float, rear_rad: float, speed_mps: float) -> float:
    """Return v of eq. 5.6 as printed, with ``lr cos δr`` in place of a speed."""
    lever = GEOMETRY.front_axle_m * math.tan(rear_rad) + GEOMETRY.rear_axle_m * math.tan(front_rad)
    sideslip = math.atan(lever / GEOMETRY.wheelbase_m)
    return (speed_mps * math.cos(front_rad) + GEOMETRY.rear_axle_m * math.cos(rear_rad)) / (2.0 * math.cos(sideslip))


def printed_yaw_rate(front_rad: float, rear_rad: float, speed_mps: float) -> float:
    """Return the yaw rate of eq. 5.8 as printed, with ``tan δf + tan δr``."""
    speed, sideslip, _ = body_motion(front_rad, rear_rad, speed_mps, speed_mps, GEOMETRY)
    turning = math.tan(front_rad) + math.tan(rear_rad)
    return float(speed) * math.cos(float(sideslip)) * turning / GEOMETRY.wheelbase_m


def _kinematics() -> list[tuple[str, str, str, str]]:
    crab = math.radians(20.0)
    wrong_speed = printed_speed(0.0, 0.0, _FULL_SPEED_MPS)
    wrong_yaw = math.degrees(printed_yaw_rate(crab, crab, _FULL_SPEED_MPS))
    return [
        ("eq. 5.6", "lr cos δr", f"straight ahead at 0.32 m/s it gives {wrong_speed:.3f} m/s", "vr cos δr"),
        (
            "eq. 5.8",
            "tan δf + tan δr",
            f"crab at 20° would yaw at {wrong_yaw:.0f} °/s, and 5.7 says crab",
            "tan δf − tan δr",
        ),
        (
            "eq. 6.7",
            "v = distance of two frames",
            f"at 120 Hz 0.32 m/s would read {0.32 / 120.0:.4f}",
            "divide by time, as the code does",
        ),
        (
            "appendix A",
            "cases 1, 2 by exact equality",
            "never true of measured numbers; case 1 also has the wrong sign",
            "one signed formula",
        ),
    ]


def _fits() -> list[tuple[str, str, str, str]]:
    slopes = {a: (refit_line(a, 1).coefficients[0], refit_line(a, 2).coefficients[0]) for a in ("front", "rear")}
    worst = min(half_speed_errors().values())
    return [
        (
            f"eq. 7.{number}",
            f"{slopes[axle][0]:.4f} °/µs",
            f"saturated points are in the fit; without them {slopes[axle][1]:.4f}",
            "a line with end stops",
        )
        for number, axle in ((1, "front"), (2, "rear"))
    ] + [
        (
            "eq. 7.3",
            "coefficients to 3 digits",
            f"v(1500 µs) = {printed_cubic(1500.0):.2f} m/s",
            "the refit, all digits",
        ),
        ("7.4", "a cubic", f"near half speed up to {worst:.1f} %", "dead band and saturation, or the table"),
        (
            "table 7.3",
            "one pulse per row",
            "the rear axle was sent 3000 − pulse: its angle is opposite",
            "own servo's pulse",
        ),
        (
            "7.3",
            "too few points for a cubic",
            f"11 points suffice; the front cubic reaches R² {_front_cubic():.4f}",
            "end stops, not a cubic",
        ),
    ]


def _front_cubic() -> float:
    table = steering_table("front")
    return fit_polynomial(table.pulse_us[1:-1], table.median_deg[1:-1], 3).r_squared


def _measurements() -> list[tuple[str, str, str, str]]:
    count = count_mirrored()
    rear = idle_axle_table("rear").median_deg
    pulse, front, _ = verification_table()
    slope = float(np.polyfit(pulse, front, 1)[0])
    later, neutral = refit_line("front", 2), steering_table("front").median_deg[6]
    single = cornering_table().speed_mps["single"][list(cornering_table().drive_us).index(1700.0)]
    net = 1000.0 * (driven_distance(_FULL_SPEED_MPS, 6.25, "accelerate_and_brake") - 2.0)
    return [
        (
            "table 7.1",
            "rear axle at 1500 µs",
            f"drifts {rear.min():.2f}° … {rear.max():.2f}° with the front",
            f"a lever arm of {1e3 * abs(common_lever_arm()[0]):.0f} mm",
        ),
        (
            "table 6.1",
            "the same servos",
            (
                f"front {slope:.4f} °/µs and {front[3]:+.2f}° at 1500 µs; table 7.1 has "
                f"{later.coefficients[0]:.4f} and {neutral:+.2f}°"
            ),
            "not one calibration",
        ),
        ("appendix B", f"{count.pairs} mirrored pairs", f"{count.identical} are identical", "count pairs once"),
        (
            "appendix B",
            "1700 µs, single",
            (
                f"{single[1]:.2f} at 1100, {single[2]:.2f} at 1300, {single[3]:.2f} at 1500 µs: not monotone, in "
                "both halves"
            ),
            "0.23 was meant?",
        ),
        (
            "8.1",
            "ramps are negligible: 4.7 % of 10 s",
            f"the sum of both ramps, not their effect: {net:+.0f} mm of 2 m",
            "a speed lag",
        ),
        (
            "table 8.2",
            "11 intervals 3000 s apart",
            f"the last would start at {endurance_table()[0][-1]:.0f} s of {ENDURANCE_S:.0f}",
            "about 2985 s",
        ),
        ("6.3", "HS-700BB: 900–1200 µs", "every table commands 900…2100 µs", "900–2100 µs"),
        (
            "8.2, 9.1",
            "'backward movement in case 6'",
            "case 6 is forward right; right turns miss, left turns do not",
            "keep both signs of Δs",
        ),
        ("8.2", "blocked order", "condition is confounded with battery and warm-up", "interleave"),
        ("9.1", "the spread decreased in all cases", _spread_claim(), "compare spreads with their error"),
    ]


def _spread_claim() -> str:
    rows = {(r.trajectory, r.condition, r.quantity): r for r in end_pose_rows()}
    both = [key for key in rows if key[1] == CONDITIONS[0]]
    grew = [k for k in both if _iqr(rows[k]) < _iqr(rows[k[0], CONDITIONS[1], k[2]])]
    shown = ", ".join(f"{k[0]} {'Δs' if k[2] == 'delta_s_mm' else 'heading'}" for k in grew)
    return f"Q3 − Q1 grew in {len(grew)} of {len(both)}: {shown}"


def _iqr(row: MeasuredRow) -> float:
    return row.q3 - row.q1


def _figures() -> list[Figure]:
    accelerating = 0.5 * 0.3**2 / ACCELERATION_MPS2
    braking = 0.5 * (0.32**2 - 0.02**2) / BRAKING_MPS2
    return [
        Figure("distance while accelerating [m]", "8.1", "0.043", accelerating, "constant acceleration assumed", 1.5),
        Figure("distance while braking [m]", "8.1", "0.099", braking, "constant braking assumed", 1.5),
        Figure("ramps of a 10 s drive [%]", "8.1", "4.7", 100.0 * 0.142 / 3.0, "of 10 s at 0.3 m/s"),
        Figure("resolution of µs against degrees", "6.3", "13.3", 1200.0 / 90.0),
    ]


def errata_section() -> ThesisSection:
    """Return the errata, each with the number that shows it."""
    rows: tuple[tuple[Cell, ...], ...] = tuple(_kinematics() + _fits() + _measurements())
    columns = ("where", "printed", "what shows it", "use instead")
    tables = (
        ThesisTable("errata", "Errata and open ends", columns, rows),
        figures_table("text_figures", "Figures in the text", _figures()),
    )
    findings = (
        (
            f"{len(rows)} places where the thesis contradicts its own tables, text or geometry, each with the number "
            "that shows it."
        ),
        (
            "Two change results: the signs and speeds of eq. 5.6 and 5.8 (the thesis' own code has them right), and "
            "the fits of eq. 7.1 to 7.3."
        ),
    )
    return ThesisSection("errata", "Errata", findings, tables)
