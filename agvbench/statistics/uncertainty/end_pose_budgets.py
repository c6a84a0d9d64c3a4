"""Uncertainty budgets of end pose errors: per trajectory and condition, of the mean over repeats.

The results are the mean end position error [mm] and the mean heading error [deg]. Noise of the camera at the rest poses
differs from run to run: the scatter of repeats contains it, so it is shown and not added. What is the same in every
run shows in no repeat: it enters as far as the lab states it (`agvbench.campaign.uncertainty_statement`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from agvbench.campaign.uncertainty_statement import Evaluation
from agvbench.errors import FitError
from agvbench.statistics.quantities import HEADING, POSITION, Quantity
from agvbench.statistics.rest_poses import RestPose, end_pose, start_pose
from agvbench.statistics.uncertainty.budget import Budget, Component, Role
from agvbench.types import Floats, Pose, Run, wrap_angle

_PER_DEG = math.pi / 180.0
_ONE_RUN = "one repeat: drive more (bench --repeats)"
_STATED = "stated"
REPEATS = "repeats"
CLOCK = "clock_ms"
SOURCES = {
    "camera_position_mm": ("camera: position at start and end, per axis", "mm"),
    "camera_scale_ppm": ("camera: scale of lengths", "ppm"),
    "camera_heading_deg": ("camera: heading at start and end", "deg"),
    "marker_offset_mm": ("centroid of the markers on the vehicle, per axis", "mm"),
    "heading_alignment_deg": ("alignment of the markers' heading", "deg"),
    CLOCK: ("capture clock and latency", "ms"),
}
"""What a lab can state, by key of ``[uncertainty]``: in words, and the unit of the standard uncertainty."""


@dataclass(frozen=True)
class EndPoseBudget:
    """The budget of one quantity on one trajectory under one condition, from `repeats` runs."""

    trajectory: str
    condition: str
    quantity: Quantity
    repeats: int
    budget: Budget


def end_pose_budgets(runs: Iterable[Run], stated: Mapping[str, Evaluation] | None = None) -> list[EndPoseBudget]:
    """Return two budgets for each trajectory and condition, in the order of their first runs.

    Parameters
    ----------
    runs
        Those that do not count, or have no target or no rest pose, are left out.
    stated
        Type B evaluations by key of `SOURCES`.
    """
    return budgets_of([one for run in runs if run.is_ok and run.target.is_finite for one in _measured(run)], stated)


def budgets_of(measured: list[RestPoses], stated: Mapping[str, Evaluation] | None = None) -> list[EndPoseBudget]:
    """Return what `end_pose_budgets` does, from rest poses."""
    first = {key: at for at, key in reversed(list(enumerate(one.key for one in measured)))}
    found = []
    for (trajectory, condition), group in groupby(
        sorted(measured, key=lambda one: first[one.key]), lambda one: one.key
    ):
        sample = _Sample(list(group))
        for quantity, budget in ((POSITION, _position), (HEADING, _heading)):
            found.append(EndPoseBudget(trajectory, condition, quantity, len(sample.runs), budget(sample, stated or {})))
    return found


@dataclass(frozen=True)
class RestPoses:
    """One run by its rest poses (floor frame), its target (start frame) and the delay of its frames.

    ``key`` is trajectory and condition; ``delay_s`` is the median time from capture to receipt, NaN if not recorded.
    """

    key: tuple[str, str]
    target: Pose
    start: RestPose
    end: RestPose
    delay_s: float = math.nan


def _measured(run: Run) -> Iterator[RestPoses]:
    try:
        start, end = start_pose(run), end_pose(run)
    except FitError:
        return
    delays = run.frames.received_s - run.frames.t_s
    known = delays[np.isfinite(delays)]
    delay_s = float(np.median(known)) if len(known) else math.nan
    yield RestPoses((run.trajectory, run.condition), run.target, start, end, delay_s)


class _Sample:
    """The repeats of one trajectory under one condition, in the start frame.

    ``reached`` and ``error`` have shape (n, 2) [mm], ``heading`` and ``rotation`` (n,) [deg and rad]; ``outward`` are
    unit vectors of the error, zero where there is none: the gradient of the end position error.
    """

    def __init__(self, runs: list[RestPoses]) -> None:
        self.runs = runs
        ends = [one.end.pose.relative_to(one.start.pose) for one in runs]
        targets = [one.target for one in runs]
        self.reached = 1e3 * np.array([end[:2] for end in ends])
        self.error = self.reached - 1e3 * np.array([target[:2] for target in targets])
        self.rotation = np.array([end.heading_rad for end in ends])
        turned = [wrap_angle(end.heading_rad - to.heading_rad) for end, to in zip(ends, targets, strict=True)]
        self.heading = np.degrees(turned)
        self.distance = np.hypot(*self.error.T)
        self.outward = self.error / np.where(self.distance > 0.0, self.distance, 1.0)[:, np.newaxis]

    @property
    def across_path(self) -> Floats:
        """Change of the end position error per rotation of the start frame, shape (n,) [mm/rad]."""
        x, y = self.reached.T
        return np.asarray(self.outward[:, 0] * y - self.outward[:, 1] * x)

    @property
    def along_path(self) -> Floats:
        """Change of the end position error per relative change of all lengths, shape (n,) [mm]."""
        return np.asarray(np.sum(self.outward * self.reached, axis=1))

    @property
    def lever(self) -> Floats:
        """Change of the mean end position error per offset (2,) of the centroid on the vehicle [1]."""
        c, s = np.cos(self.rotation) - 1.0, np.sin(self.rotation)
        x, y = self.outward.T
        return np.array([np.mean(c * x + s * y), np.mean(c * y - s * x)])

    def noise(self, values: Floats) -> float:
        """Return the standard uncertainty of a mean over repeats from those (n,) of single runs; NaN if unknown."""
        known = values[np.isfinite(values)]
        return math.sqrt(float(np.mean(known**2)) / len(self.runs)) if len(known) else math.nan

    def frames(self, at: str) -> float:
        """Return the pooled degrees of freedom of the rest poses ``start`` or ``end``."""
        return float(max(1, sum(getattr(one, at).frames - 1 for one in self.runs)))

    @property
    def delay_ms(self) -> float:
        """The median delay between capture and receipt [ms]; NaN if not recorded."""
        return 1e3 * float(np.median([one.delay_s for one in self.runs]))

    def at_rest(self, name: str) -> float:
        """Return the root mean square of a velocity at both rest poses together; what noise makes of it is in it."""
        squares = [getattr(pose, name) ** 2 for one in self.runs for pose in (one.start, one.end)]
        known = [square for square in squares if math.isfinite(square)]
        return math.sqrt(2.0 * float(np.mean(known))) if known else 0.0


def _position(sample: _Sample, stated: Mapping[str, Evaluation]) -> Budget:
    middle = float(np.hypot(*sample.outward.mean(axis=0)))
    turning = sample.across_path * _PER_DEG
    sensitivities = {
        "camera_position_mm": math.sqrt(2.0) * middle,
        "camera_scale_ppm": 1e-6 * float(sample.along_path.mean()),
        "camera_heading_deg": float(turning.mean()),
        "marker_offset_mm": float(np.hypot(*sample.lever)),
        "heading_alignment_deg": float(turning.mean()),
        CLOCK: sample.at_rest("speed_mps"),  # mm/ms
    }
    components = [_repeats(sample.distance, "mm")]
    role = _role_of_noise(sample)
    for at in ("start", "end"):
        errors = np.array([1e3 * getattr(one, at).stderr_position_m for one in sample.runs])
        components.append(_noise(f"camera noise: {at} position", sample, errors, "mm", 1.0, at, role))
    headings = np.degrees([one.start.stderr_heading_rad for one in sample.runs])
    lever = math.sqrt(float(np.mean(turning**2)))
    components.append(_noise("camera noise: start heading", sample, headings, "deg", lever, "start", role))
    return Budget(float(sample.distance.mean()), "mm", [*components, *_systematic(sample, stated, sensitivities)])


def _heading(sample: _Sample, stated: Mapping[str, Evaluation]) -> Budget:
    turn_rate = math.degrees(sample.at_rest("turn_rate_radps"))
    sensitivities = {"camera_heading_deg": math.sqrt(2.0), CLOCK: 1e-3 * turn_rate}
    components = [_repeats(sample.heading, "deg")]
    for at in ("start", "end"):
        errors = np.degrees([getattr(one, at).stderr_heading_rad for one in sample.runs])
        components.append(_noise(f"camera noise: {at} heading", sample, errors, "deg", 1.0, at, _role_of_noise(sample)))
    return Budget(float(sample.heading.mean()), "deg", [*components, *_systematic(sample, stated, sensitivities)])


def _repeats(values: Floats, unit: str) -> Component:
    """Return the type A component: the standard deviation of the mean of `values`, shape (n,)."""
    n = len(values)
    if n < 2:
        return Component(REPEATS, "A", "t", math.nan, unit, 1.0, math.nan, Role.NOT_STATED, _ONE_RUN)
    mean = float(np.std(values, ddof=1)) / math.sqrt(n)
    return Component(REPEATS, "A", "t", mean, unit, 1.0, n - 1.0, remark=f"mean of {n}")


def _role_of_noise(sample: _Sample) -> Role:
    return Role.IN_REPEATS if len(sample.runs) > 1 else Role.COMBINED


def _noise(
    source: str, sample: _Sample, errors: Floats, unit: str, sensitivity: float, at: str, role: Role
) -> Component:
    uncertainty = sample.noise(errors)
    if not math.isfinite(uncertainty):
        lacking = "one frame at rest: raise the frame rate"
        return Component(source, "B", "normal", math.nan, unit, sensitivity, math.nan, Role.NOT_STATED, lacking)
    return Component(
        source, "B", "normal", uncertainty, unit, sensitivity, sample.frames(at), role, "from frames at rest"
    )


def _systematic(
    sample: _Sample, stated: Mapping[str, Evaluation], sensitivities: Mapping[str, float]
) -> Iterator[Component]:
    """Yield what is the same in every run: stated, or from delays, or not stated."""
    for key, sensitivity in sensitivities.items():
        source, unit = SOURCES[key]
        remark = _STATED
        evaluation = stated.get(key)
        if evaluation is None and key == CLOCK and sample.delay_ms > 0.0:
            # A frame is captured before it is received: its time is wrong by no more than its delay.
            evaluation = Evaluation(sample.delay_ms / math.sqrt(3.0), "rectangular")
            remark = "limits ± delay of frames; times the speed at rest"
        if evaluation is None:
            how = f"state {key} in [uncertainty]"
            yield Component(source, "B", "", math.nan, unit, sensitivity, math.nan, Role.NOT_STATED, how)
        else:
            numbers = evaluation.standard_uncertainty, unit, sensitivity, evaluation.degrees_of_freedom
            yield Component(source, "B", evaluation.distribution, *numbers, remark=remark)
