"""Predictions beside the 28 measured rows, and beside the null prediction "it hits the target".

The thesis prints magnitudes: Δs always, Δδ on the straights, the rotation of a turn. So a prediction is compared as a
magnitude too, which grants it the sign; `other_sign` is its error if the sign went the other way.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from statistics import median

from agvbench.workflows.thesis.assumptions import Assumptions, Condition
from agvbench.workflows.thesis.prediction import Prediction, predict_all
from agvbench.workflows.thesis.tables import MeasuredRow, end_pose_rows

CONDITIONS: tuple[Condition, ...] = ("uncalibrated", "calibrated")
QUANTITIES = ("delta_s_mm", "delta_heading_deg")
Group = tuple[str, str, str]


@dataclass(frozen=True)
class ScoredRow:
    """A measured median, its prediction (signed) and its null, in mm or deg."""

    measured: MeasuredRow
    predicted: float
    null: float
    has_sign: bool

    @property
    def group(self) -> Group:
        """(condition, ``straight`` or ``turn``, quantity)."""
        shape = "turn" if self.measured.trajectory >= 5 else "straight"
        return self.measured.condition, shape, self.measured.quantity

    @property
    def error(self) -> float:
        """Distance between the magnitude predicted and the magnitude printed."""
        return abs(abs(self.predicted) - self.measured.median)

    @property
    def other_sign(self) -> float:
        """The same if the measured one has the opposite sign; equal to `error` where the sign is known."""
        return self.error if self.has_sign else abs(self.predicted) + self.measured.median

    @property
    def null_error(self) -> float:
        """Error of "it hits the target"."""
        return abs(self.null - self.measured.median)

    @property
    def in_quartiles(self) -> bool:
        """Whether the prediction lies between the quartiles of the ten drives."""
        return self.measured.q1 <= abs(self.predicted) <= self.measured.q3


def score_row(measured: MeasuredRow, prediction: Prediction) -> ScoredRow:
    """Return `measured` with its prediction: Δs, or the heading in the way the thesis prints it."""
    if measured.quantity == "delta_s_mm":
        return ScoredRow(measured, prediction.delta_s_mm, 0.0, has_sign=False)
    if prediction.trajectory.is_turn:
        # Nobody confuses a left quarter turn with a right one: only its amount is open.
        amount = prediction.turned_deg * math.copysign(1.0, prediction.trajectory.heading_rad)
        return ScoredRow(measured, amount, 90.0, has_sign=True)
    return ScoredRow(measured, prediction.turned_deg, 0.0, has_sign=False)


def score(assumed: Assumptions, condition: Condition) -> list[ScoredRow]:
    """Return the scored rows of one condition, in the thesis' order."""
    by_number = {p.trajectory.number: p for p in predict_all(assumed, condition)}
    rows = (row for row in end_pose_rows() if row.condition == condition)
    return [score_row(row, by_number[row.trajectory]) for row in rows]


def score_all(assumed: Assumptions) -> list[ScoredRow]:
    """Return all 28 rows, in the thesis' order."""
    scored = {id(r.measured): r for condition in CONDITIONS for r in score(assumed, condition)}
    return [scored[id(row)] for row in end_pose_rows()]


def groups() -> tuple[Group, ...]:
    """Return the eight groups: condition × shape × quantity."""
    return tuple((c, s, q) for c in CONDITIONS for s in ("straight", "turn") for q in QUANTITIES)


def median_errors(rows: Iterable[ScoredRow], which: str = "error") -> Mapping[Group, float]:
    """Return the median of `which` (``error``, ``other_sign``, ``null_error``) per group that occurs in `rows`."""
    errors: dict[Group, list[float]] = {}
    for row in rows:
        errors.setdefault(row.group, []).append(float(getattr(row, which)))
    return {group: median(values) for group, values in errors.items()}


def score_against_null(rows: list[ScoredRow]) -> float:
    """Return how the prediction does against the null over the groups in `rows`: below 1 it is better.

    The geometric mean over groups of (prediction's median error / null's), so that mm and deg count alike. An error
    below 1 % of the null's counts as 1 %.

    >>> from agvbench.workflows.thesis.tables import MeasuredRow
    >>> score_against_null([ScoredRow(MeasuredRow(1, "calibrated", "delta_s_mm", 10.0, 8.0, 12.0), -5.0, 0.0, False)])
    0.5
    """
    ours, null = median_errors(rows), median_errors(rows, "null_error")
    logs = [math.log(max(ours[g] / null[g], 0.01)) for g in ours]
    return math.exp(sum(logs) / len(logs))
