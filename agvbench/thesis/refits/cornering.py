"""Appendix B: the speed that steering costs beyond eq. 5.6, and whether its halves are two measurements.

Held-out errors leave out one mirrored pair of steering pulses, in all modes and at all drive pulses together: the
two halves of a pair are one measurement (see `mirror`).

"Straight" speeds, here and in table 7.4, were driven at 1500 µs, where neither axle is straight. Everything is
therefore relative to that: a vehicle commanded 1500 µs drives the printed straight speed exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from agvbench.thesis.refits.steering import true_maps
from agvbench.thesis.section import Figure, ThesisSection, ThesisTable, figures_table
from agvbench.thesis.tables import GEOMETRY, NEUTRAL_US, CorneringTable, cornering_table, drive_table, rms
from agvbench.types import Floats
from agvbench.vehicle.kinematics import body_motion

PRINTED_STEP_MPS = 0.01


@dataclass(frozen=True)
class MirrorCount:
    """How many of the mirrored pairs (p, 3000 − p) of appendix B carry the same printed speed."""

    pairs: int
    identical: int
    at_rest: int
    differing: tuple[str, ...]

    @property
    def moving(self) -> int:
        """Pairs in which the vehicle moves at all."""
        return self.pairs - self.at_rest


def mirrored(speeds: Floats) -> tuple[Floats, Floats]:
    """Return the left half (pulses below 1500) and its mirror image, each of shape (drive pulses, 3)."""
    half = speeds.shape[1] // 2
    return speeds[:, :half], speeds[:, ::-1][:, :half]


def count_mirrored(table: CorneringTable | None = None) -> MirrorCount:
    """Count identical pairs; speeds are compared as printed."""
    table = table or cornering_table()
    pairs = identical = at_rest = 0
    differing: list[str] = []
    for mode, speeds in table.speed_mps.items():
        left, right = mirrored(speeds)
        same = np.isclose(left, right, atol=0.1 * PRINTED_STEP_MPS)
        pairs += same.size
        identical += int(same.sum())
        at_rest += int(((left == 0.0) & (right == 0.0)).sum())
        differing += [
            f"{table.drive_us[i]:.0f} µs, {mode}, {table.steering_us[j]:.0f}/{3000.0 - table.steering_us[j]:.0f}: "
            f"{left[i, j]:.2f} and {right[i, j]:.2f} m/s"
            for i, j in np.argwhere(~same)
        ]
    return MirrorCount(pairs, identical, at_rest, tuple(differing))


def expected_differing(model_mps: dict[str, Floats], noise_mps: float) -> float:
    """Return how many pairs should differ in print if both halves had been driven.

    `model_mps` is what an asymmetric vehicle would do, per mode like the table; each half adds independent noise of
    standard deviation `noise_mps` before rounding. Summed over all printable values: no random numbers.
    """
    return sum(float(np.sum(1.0 - _same_print(*mirrored(m), noise_mps))) for m in model_mps.values())


def _same_print(left: Floats, right: Floats, noise_mps: float) -> Floats:
    from scipy.stats import norm

    steps = np.arange(-0.02, 0.5, PRINTED_STEP_MPS)[:, None, None]
    left_share, right_share = (
        np.diff(norm.cdf(steps - 0.5 * PRINTED_STEP_MPS, speed, noise_mps), axis=0) for speed in (left, right)
    )
    return np.asarray((left_share * right_share).sum(axis=0))


def straight_speeds_repeated(table: CorneringTable | None = None) -> int:
    """Return for how many drive pulses the three modes print one straight speed (it was driven once, at most)."""
    columns = _straight(table or cornering_table())
    return int(np.sum(np.ptp(columns, axis=1) == 0.0))


def _straight(table: CorneringTable) -> Floats:
    return np.stack([speeds[:, speeds.shape[1] // 2] for speeds in table.speed_mps.values()], axis=1)


def identical_blocks(table: CorneringTable | None = None) -> list[tuple[float, float]]:
    """Return pairs of drive pulses whose 21 printed speeds are all the same and not all zero."""
    table = table or cornering_table()
    blocks = np.concatenate(list(table.speed_mps.values()), axis=1)
    return [
        (float(table.drive_us[i]), float(table.drive_us[j]))
        for i in range(len(blocks))
        for j in range(i + 1, len(blocks))
        if np.array_equal(blocks[i], blocks[j]) and blocks[i].any()
    ]


Form = Callable[[Floats, Floats], Floats]

#: Table 7.4 varies by 0.8 mm/s where it is flat (900…1150 µs): about what one more median would add.
REPEAT_NOISE_MPS = 0.001


@dataclass(frozen=True)
class Samples:
    """Appendix B where it moves and steers: every array has shape (n,)."""

    mode: Floats
    straight_mps: Floats
    front_rad: Floats
    rear_rad: Floats
    speed_mps: Floats
    pair_us: Floats


def _angles(mode: str, steering_us: Floats) -> tuple[Floats, Floats]:
    front_map, rear_map = true_maps("monotone")
    rear_us = {"single": np.full_like(steering_us, NEUTRAL_US), "double": 3000.0 - steering_us, "crab": steering_us}
    return front_map(steering_us), rear_map(rear_us[mode])


@cache
def samples() -> Samples:
    """Return the samples that identify a loss: steered, and moving straight ahead at all."""
    table = cornering_table()
    parts: list[tuple[Floats, ...]] = []
    for index, (mode, grid) in enumerate(table.speed_mps.items()):
        front, rear = _angles(mode, table.steering_us)
        straight = grid[:, [grid.shape[1] // 2]]
        columns = np.broadcast_arrays(float(index), straight, front, rear, grid, np.abs(table.steering_us - NEUTRAL_US))
        kept = (straight > 0.015) & (table.steering_us != NEUTRAL_US)
        parts.append(tuple(column[kept] for column in columns))
    return Samples(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def steering_measure(front_rad: ArrayLike, rear_rad: ArrayLike) -> Floats:
    """Return |tan δf| + |tan δr|, the measure of the effect ``cornering_speed_loss``."""
    return np.abs(np.tan(front_rad)) + np.abs(np.tan(rear_rad))


def cornering_share(front_rad: ArrayLike, rear_rad: ArrayLike, loss: float) -> Floats:
    """Return the share of speed that is kept."""
    return np.asarray(1.0 - loss * steering_measure(front_rad, rear_rad))


def _curvature(front_rad: Floats, rear_rad: Floats) -> Floats:
    _, sideslip, _ = body_motion(front_rad, rear_rad, 1.0, 1.0, GEOMETRY)
    return np.asarray(np.abs(np.cos(sideslip) * (np.tan(front_rad) - np.tan(rear_rad))) / GEOMETRY.wheelbase_m)


FORMS: dict[str, Form] = {
    "|tan δf| + |tan δr|": steering_measure,
    "|δf| + |δr|": lambda f, r: np.abs(f) + np.abs(r),
    "δf² + δr²": lambda f, r: f**2 + r**2,
    "|curvature|": _curvature,
    "curvature²": lambda f, r: _curvature(f, r) ** 2,
}


def _neutral(form: Form) -> tuple[float, float]:
    """Return eq. 5.6's share of speed and the measure `form` at 1500 µs."""
    front, rear = (np.asarray(m(NEUTRAL_US)) for m in true_maps("monotone"))
    speed, _, _ = body_motion(front, rear, 1.0, 1.0, GEOMETRY)
    return float(speed), float(form(front, rear))


def _explained(s: Samples) -> Floats:
    """Return the speed [m/s] that eq. 5.6 leaves of the straight one."""
    speed, _, _ = body_motion(s.front_rad, s.rear_rad, s.straight_mps, s.straight_mps, GEOMETRY)
    return speed / _neutral(steering_measure)[0]


def fit_loss(form: Form, kept: Floats | None = None) -> float:
    """Return the loss c of ``v = eq. 5.6 · (1 − c · form) / (1 − c · form at 1500 µs)``, from the samples `kept`.

    Multiplied out this is linear in c, so least squares is one division.
    """
    s = samples()
    keep = np.ones(len(s.speed_mps), bool) if kept is None else kept
    base = _explained(s)
    column = base * form(s.front_rad, s.rear_rad) - s.speed_mps * _neutral(form)[1]
    return float(np.dot(column[keep], (base - s.speed_mps)[keep]) / np.dot(column[keep], column[keep]))


@cache
def fitted_loss() -> float:
    """Return the loss per |tan δf| + |tan δr| of appendix B."""
    return fit_loss(steering_measure)


def residual_of(form: Form, loss: float) -> Floats:
    """Return what eq. 5.6 with a `loss` of this form leaves of every sample [m/s]; a loss of 0 is eq. 5.6 alone."""
    s = samples()
    share = (1.0 - loss * form(s.front_rad, s.rear_rad)) / (1.0 - loss * _neutral(form)[1])
    return s.speed_mps - _explained(s) * share


def held_out_rms_mm(form: Form) -> float:
    """Return the rms error [mm/s] with each pair of mirrored steering pulses predicted from the other pairs."""
    s = samples()
    errors = np.empty_like(s.speed_mps)
    for pair in np.unique(s.pair_us):
        out = s.pair_us == pair
        errors[out] = residual_of(form, fit_loss(form, ~out))[out]
    return 1000.0 * rms(errors)


def _form_rows() -> tuple[tuple[str, float | None, float, float], ...]:
    none = 1000.0 * rms(residual_of(steering_measure, 0.0))
    rows: list[tuple[str, float | None, float, float]] = [("eq. 5.6 alone", None, none, none)]
    for name, form in FORMS.items():
        loss = fit_loss(form)
        rows.append((f"eq. 5.6 and {name}", loss, 1000.0 * rms(residual_of(form, loss)), held_out_rms_mm(form)))
    return tuple(rows)


def _would_differ() -> float:
    """Return how many mirrored pairs our own model, with asymmetric servos, would print differently."""
    table = cornering_table()
    predicted = {}
    for mode in table.speed_mps:
        front, rear = _angles(mode, table.steering_us)
        straight = np.abs(np.interp(table.drive_us, *drive_table()))[:, None]
        speed, _, _ = body_motion(front, rear, straight, straight, GEOMETRY)
        share = cornering_share(front, rear, fitted_loss())
        predicted[mode] = np.where(straight > 0.015, speed * share, 0.0)
    return expected_differing(predicted, REPEAT_NOISE_MPS)


def _asymmetry() -> str:
    """Return each servo's stops and the pulse at which it is straight, in words."""
    words = []
    for axle, servo in zip(("front", "rear"), true_maps("end_stops"), strict=True):
        low, high = np.degrees(servo.output_range)
        words.append(f"{axle} {low:.1f}° … {high:.1f}°, straight at {float(servo.inverse(0.0)):.0f} µs")
    return "; ".join(words)


def cornering_section() -> ThesisSection:
    """Return what appendix B holds, and the loss fitted to it."""
    count, blocks, rows = count_mirrored(), identical_blocks(), _form_rows()
    measured = sum(grid.size for grid in cornering_table().speed_mps.values())
    findings = (
        (
            f"{count.identical} of {count.pairs} mirrored pairs print the same speed ({count.at_rest} of them at "
            f"rest); the other is {'; '.join(count.differing)}. The servos are not symmetric ({_asymmetry()}): "
            f"driven twice, about {_would_differ():.0f} pairs would differ in print. The halves were mirrored or "
            "averaged: they count, and are split, as one."
        ),
        (
            f"The straight column is the same in all three modes for {straight_speeds_repeated()} of 16 drive "
            f"pulses, and the blocks {', '.join(f'{a:.0f} and {b:.0f} µs' for a, b in blocks)} are equal in all 21 "
            "cells: 336 printed medians are at most 160 different measurements."
        ),
        (
            f"The residual of eq. 5.6 in appendix B is {rows[0][3]:.1f} mm/s rms; a loss of {fitted_loss():.4f} per "
            f"|tan δf| + |tan δr| leaves {rows[1][3]:.1f} held out (the printed step of 10 mm/s alone gives 2.9). "
            "Forms in curvature do worse: crab, which does not turn, loses speed too."
        ),
    )
    figures = [
        Figure("median velocities", "7.2", "336", float(measured)),
    ]
    columns = ("model", "loss", "rms [mm/s]", "held-out rms [mm/s]")
    tables = (
        figures_table("cornering", "Appendix B as printed", figures),
        ThesisTable(
            "cornering_forms", "Speed lost in corners: competing forms", columns, rows, "Held out: mirrored pairs."
        ),
    )
    values = {"loss": fitted_loss(), "mirrored_pairs": count.pairs, "mirrored_identical": count.identical}
    return ThesisSection("cornering", "Cornering (appendix B)", findings, tables, dict(values))
