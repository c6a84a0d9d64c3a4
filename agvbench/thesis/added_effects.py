"""One effect at a time added to the prediction of chapter 8: fitted on one condition, checked on the other.

Each has one parameter. Rows are compared as the thesis prints them (magnitudes), each error over the median error of
the null prediction for its quantity and shape, so that millimetres and degrees count alike; a fit minimises the mean.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from statistics import mean, median

import numpy as np

from agvbench.thesis.prediction.assumptions import Assumptions, Condition
from agvbench.thesis.prediction.commands import CommandedDrive, commanded, true_speed
from agvbench.thesis.prediction.end_pose import EndPosePrediction, arc_end, driven, neutral_share
from agvbench.thesis.prediction.scoring import CONDITIONS, ScoredRow, score_row
from agvbench.thesis.prediction.trajectories import ThesisTrajectory
from agvbench.thesis.refits.cornering import cornering_share, fitted_loss
from agvbench.thesis.refits.steering import true_maps
from agvbench.thesis.section import ThesisTable
from agvbench.thesis.tables import GEOMETRY, end_pose_rows
from agvbench.vehicle.kinematics import body_motion

_VALUES = 81


@dataclass
class PredictedDrive:
    """One drive while effects act on it: axle angles [rad], distance along the wheels [m], curvature added [1/m]."""

    front_rad: float
    rear_rad: float
    distance_m: float
    speed_mps: float
    side: int
    curvature_per_m: float = 0.0
    bend: float = 1.0


@dataclass(frozen=True)
class Cause:
    """An effect of one parameter: its `unit`, the range looked in, and how it changes a drive."""

    name: str
    unit: str
    low: float
    high: float
    act: Callable[[PredictedDrive, float], None]


def _reverse(d: PredictedDrive, gain: float) -> None:
    if d.distance_m < 0.0:
        d.front_rad, d.rear_rad = (1.0 + gain) * d.front_rad, (1.0 + gain) * d.rear_rad


def _right(d: PredictedDrive, gain: float) -> None:
    if d.side < 0:
        d.front_rad, d.rear_rad = (1.0 + gain) * d.front_rad, (1.0 + gain) * d.rear_rad


def _coupled(d: PredictedDrive, share: float) -> None:
    d.front_rad, d.rear_rad = d.front_rad + share * d.rear_rad, d.rear_rad + share * d.front_rad


def _wheels(d: PredictedDrive, curvature: float) -> None:
    d.curvature_per_m = curvature


def _slip(d: PredictedDrive, gradient: float) -> None:
    d.bend = 1.0 / (1.0 + gradient * d.speed_mps**2)


def _roll(d: PredictedDrive, seconds: float) -> None:
    d.distance_m += d.speed_mps * seconds


def _faster(d: PredictedDrive, share: float) -> None:
    d.distance_m *= 1.0 + share


def _offset(d: PredictedDrive, angle: float) -> None:
    d.front_rad, d.rear_rad = d.front_rad + angle, d.rear_rad - angle


CAUSES = (
    Cause("reverse_steering_gain", "–", -0.4, 0.4, _reverse),
    Cause("steering gain to the right", "–", -0.4, 0.4, _right),
    Cause("axle_coupling, both alike", "–", -0.4, 0.4, _coupled),
    Cause("wheel_diameter_mismatch", "1/m", -0.1, 0.1, _wheels),
    Cause("lateral_slip", "s²/m²", -3.0, 3.0, _slip),
    Cause("speed_lag, braking less accelerating", "s", -0.4, 0.4, _roll),
    Cause("speed off by a share", "–", -0.15, 0.15, _faster),
    Cause("straight ahead off, opposite", "rad", -0.05, 0.05, _offset),
)


@cache
def _commanded_drives(
    condition: Condition, assumed: Assumptions
) -> tuple[tuple[ThesisTrajectory, CommandedDrive, PredictedDrive], ...]:
    drives = []
    for trajectory in driven(condition):
        command = commanded(trajectory, condition, assumed)
        front, rear = true_maps(assumed.true_steering)
        speed = true_speed(command.drive_us, assumed.true_drive if condition == "calibrated" else "measured")
        angles = float(front(command.front_us)), float(rear(command.rear_us))
        drives.append(
            (trajectory, command, PredictedDrive(*angles, speed * command.duration_s, speed, trajectory.side))
        )
    return tuple(drives)


def predicted(cause: Cause | None, value: float, condition: Condition, assumed: Assumptions) -> list[EndPosePrediction]:
    """Return the predictions of one condition with `cause` at `value`; without a cause those of the plain model."""
    neutral = neutral_share(assumed.true_steering, fitted_loss())
    out = []
    for trajectory, command, as_commanded in _commanded_drives(condition, assumed):
        drive = replace(as_commanded)
        if cause is not None:
            cause.act(drive, value)
        speed, sideslip, yaw = (float(x) for x in body_motion(drive.front_rad, drive.rear_rad, 1.0, 1.0, GEOMETRY))
        kept = float(cornering_share(drive.front_rad, drive.rear_rad, fitted_loss())) / neutral
        length = drive.distance_m * kept * speed
        turned = drive.distance_m * kept * yaw * drive.bend + drive.curvature_per_m * length
        end, turned = arc_end(length, sideslip, turned)
        delta_s = math.hypot(end.x_m, end.y_m) - trajectory.distance_m(assumed.turn_target)
        out.append(EndPosePrediction(trajectory, condition, command, end, math.degrees(turned), 1000.0 * delta_s))
    return out


def rows_with(cause: Cause | None, value: float) -> list[ScoredRow]:
    """Return the 28 rows with `cause` at `value`."""
    assumed = Assumptions()
    by_key: dict[tuple[int, str], EndPosePrediction] = {
        (p.trajectory.number, c): p for c in CONDITIONS for p in predicted(cause, value, c, assumed)
    }
    return [score_row(row, by_key[row.trajectory, row.condition]) for row in end_pose_rows()]


@cache
def scales() -> Mapping[tuple[str, str], float]:
    """Return the null's median error by (shape, quantity) over all rows: the unit of errors."""
    found: dict[tuple[str, str], list[float]] = {}
    for row in rows_with(None, 0.0):
        found.setdefault(row.group[1:], []).append(row.null_error)
    return {key: median(values) for key, values in found.items()}


def mean_error(rows: Iterable[ScoredRow]) -> float:
    """Return the mean error of rows over `scales`."""
    return mean(row.error / scales()[row.group[1:]] for row in rows)


def null_error(rows: Iterable[ScoredRow]) -> float:
    """Return the mean error of "it hits the target" over `scales`."""
    return mean(row.null_error / scales()[row.group[1:]] for row in rows)


Chosen = Callable[[ScoredRow], bool]


@cache
def _table(cause: Cause) -> list[tuple[float, list[ScoredRow]]]:
    return [(float(v), rows_with(cause, float(v))) for v in np.linspace(cause.low, cause.high, _VALUES)]


def fitted(cause: Cause, chosen: Chosen) -> tuple[float, list[ScoredRow]]:
    """Return the value of `cause` that fits the `chosen` rows best, and all rows at it."""
    return min(_table(cause), key=lambda pair: mean_error(r for r in pair[1] if chosen(r)))


@dataclass(frozen=True)
class Checked:
    """One cause: its value from each condition, mean errors on the other condition before and after, and without it.

    ``left_out`` is the mean error on trajectories that the value was not fitted to, one at a time.
    """

    cause: Cause
    value: Mapping[str, float]
    before: Mapping[str, float]
    after: Mapping[str, float]
    left_out_before: float
    left_out_after: float

    @property
    def carries_over(self) -> bool:
        """Whether it helps on the drives it was not fitted to, both ways and trajectory by trajectory."""
        both = all(self.after[c] < self.before[c] for c in CONDITIONS)
        return both and self.left_out_after < self.left_out_before


def check(cause: Cause) -> Checked:
    """Return `cause` fitted to the uncalibrated rows and checked on the calibrated ones, and back."""
    plain = rows_with(None, 0.0)
    value: dict[str, float] = {}
    before: dict[str, float] = {}
    after: dict[str, float] = {}
    for own, other in zip(CONDITIONS, reversed(CONDITIONS), strict=True):
        value[own], rows = fitted(cause, lambda r, own=own: r.measured.condition == own)  # type: ignore[misc]
        before[other] = mean_error(r for r in plain if r.measured.condition == other)
        after[other] = mean_error(r for r in rows if r.measured.condition == other)
    kept = []
    for n in range(1, 9):
        _, rows = fitted(cause, lambda r, n=n: r.measured.trajectory != n)  # type: ignore[misc]
        kept += [r for r in rows if r.measured.trajectory == n]
    return Checked(cause, value, before, after, mean_error(plain), mean_error(kept))


@cache
def checks() -> tuple[Checked, ...]:
    """Return every cause, checked."""
    return tuple(check(cause) for cause in CAUSES)


def chapter_8_table() -> ThesisTable:
    """Return each effect's value from either condition, and the errors before and after on the other's drives."""
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
    return ThesisTable(
        "residuals_chapter_8", "Chapter 8: one effect at a time, carried over", columns, rows, note, (), 3
    )


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


def chapter_8_findings() -> list[str]:
    """Return how many effects carry over, and what the first of them make of the turns."""
    carried = [k for k in checks() if k.carries_over]
    null = null_error(r for r in rows_with(None, 0.0) if r.measured.condition == "calibrated")
    best = min(k.after["calibrated"] for k in checks())
    return [
        f"Chapter 8: of {len(CAUSES)} effects, {len(carried)} help on the drives they were not fitted to, both "
        "ways and by trajectory"
        + (f" ({', '.join(k.cause.name for k in carried)})" if carried else "")
        + f". The best of all scores {best:.2f} on the calibrated rows, where 'it hits the target' scores "
        f"{null:.2f}: on medians of unsigned errors, and after trying {len(CAUSES)}, none is established. A "
        "constant curvature is also what a neutral that is off does: calibration, before it is a cause.",
        *map(_asymmetry, carried[:2]),
    ]


def _asymmetry(checked: Checked) -> str:
    measured, before, after = asymmetry_with(checked)
    return (
        f"Calibrated right turns miss by {measured:.0f} mm more than left ones; predicted {before:+.0f}, and "
        f"{after:+.0f} with {checked.cause.name} at {checked.value['uncalibrated']:.3g} {checked.cause.unit}, the "
        f"value of the uncalibrated drives ({checked.value['calibrated']:.3g} from the calibrated)."
    )
