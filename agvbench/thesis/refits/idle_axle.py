"""Why the axle that stands still seems to turn (tables 7.1 and 7.2): lever arm or coupling, held out.

If the markers' centroid lies e further forward than the vehicle file says, every axle angle is measured with the wrong
lever: tan δ is off by e·κ on *both* axles, κ being the curvature driven. A coupling of the servos instead gives
each axle a share of the other's angle, with two free signs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from agvbench.thesis.section import Cell, ThesisSection, ThesisTable
from agvbench.thesis.tables import GEOMETRY, idle_axle_table, rms, steering_table
from agvbench.types import Floats
from agvbench.vehicle.kinematics import body_motion

IDLE = ("rear", "front")
OTHER = {"rear": "front", "front": "rear"}


@dataclass(frozen=True)
class Idle:
    """The axle at 1500 µs while the other turns: its tangent, the curvature driven [1/m], the other's angle [rad]."""

    tangent: Floats
    curvature_per_m: Floats
    other_rad: Floats


def idle(axle: str) -> Idle:
    """Return the axle that stood still: ``"rear"`` in table 7.1, ``"front"`` in table 7.2."""
    still = np.radians(idle_axle_table(axle).median_deg)
    other = np.radians(steering_table(OTHER[axle]).median_deg)
    front, rear = (other, still) if axle == "rear" else (still, other)
    _, sideslip, _ = body_motion(front, rear, 1.0, 1.0, GEOMETRY)
    curvature = np.cos(sideslip) * (np.tan(front) - np.tan(rear)) / GEOMETRY.wheelbase_m
    return Idle(np.tan(still), curvature, other)


def slope_and_error(x: Floats, y: Floats) -> tuple[float, float, float]:
    """Return slope, its standard error and the rms left by a straight line."""
    centred = x - x.mean()
    slope = float(np.dot(centred, y) / np.dot(centred, centred))
    left = y - y.mean() - slope * centred
    error = math.sqrt(float(np.dot(left, left)) / (len(x) - 2) / float(np.dot(centred, centred)))
    return slope, error, rms(left)


def common_lever_arm() -> tuple[float, float]:
    """Return the lever arm [m] that both tables share and its standard error, each axle with its own offset."""
    parts = [idle(axle) for axle in IDLE]
    x = np.concatenate([p.curvature_per_m - p.curvature_per_m.mean() for p in parts])
    y = np.concatenate([p.tangent - p.tangent.mean() for p in parts])
    arm = float(np.dot(x, y) / np.dot(x, x))
    left = y - arm * x
    return arm, math.sqrt(float(np.dot(left, left)) / (len(x) - 3) / float(np.dot(x, x)))


def _rows() -> list[tuple[Cell, ...]]:
    rows: list[tuple[Cell, ...]] = []
    for axle in IDLE:
        part = idle(axle)
        arm, arm_error, left = slope_and_error(part.curvature_per_m, part.tangent)
        share, share_error, coupled = slope_and_error(part.other_rad, np.arctan(part.tangent))
        still = math.degrees(rms(np.arctan(part.tangent) - np.arctan(part.tangent).mean()))
        rows.append(
            (axle, still, 1e3 * arm, 1e3 * arm_error, math.degrees(left), share, share_error, math.degrees(coupled))
        )
    return rows


def lever_arm_section() -> ThesisSection:
    """Return what moves the axle that stands still."""
    rows = _rows()
    arm, error = common_lever_arm()
    columns: tuple[str, ...] = ("idle axle", "drift, rms [deg]", "lever arm [mm]", "± [mm]", "left [deg]", "coupling")
    columns += ("± coupling", "left by coupling [deg]")
    table = ThesisTable("lever_arm", "The axle that stands still", columns, tuple(rows))
    findings = (
        (
            f"One lever arm explains the drift of both tables: {rows[0][2]:.1f} ± {rows[0][3]:.1f} mm from the rear "
            f"axle of table 7.1 and {rows[1][2]:.1f} ± {rows[1][3]:.1f} mm from the front axle of table 7.2, "
            f"{1e3 * arm:.1f} ± {1e3 * error:.1f} mm together. Coupling needs two shares of opposite sign "
            f"({rows[0][5]:+.4f} and {rows[1][5]:+.4f}) and fits as well: the lever arm is the simpler of the two."
        ),
        (
            f"A negative arm means: the markers' centroid lies {-1e3 * arm:.1f} mm further back than table 5.1 says. "
            "Both axles shift alike, so the yaw rate does not change, and chapter 8 is not affected."
        ),
    )
    values: dict[str, Cell] = {"lever_arm_m": arm, "lever_arm_stderr_m": error}
    return ThesisSection("lever_arm", "The axle that stands still (tables 7.1, 7.2)", findings, (table,), values)


@cache
def idle_errors() -> dict[str, tuple[Floats, Floats, Floats]]:
    """Return, per idle axle, held-out errors [deg] of a constant and of a lever arm, and the other axle's angle [deg].

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
            rows.append(np.degrees(angle[k] - np.array([constant, lever])))
        errors = np.array(rows).T
        found[axle] = errors[0], errors[1], np.degrees(part.other_rad[1:-1])
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
