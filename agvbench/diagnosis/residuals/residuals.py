"""Prediction residuals, their repeatability, and the lack-of-fit test.

A long slalom ends ten times as far off as a short straight by the same variation of the axles: residuals of groups of
repeats can only be compared in units of their own standard deviations.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.estimation.variance import priors
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.types import Floats


@dataclass(frozen=True)
class EndSpread:
    """How far each run's last sample may be off, in its start frame [m, m, rad].

    ``own`` (R, 3, 3): covariance of run and frame, drawn anew with each repeat; ``slopes`` (R, 3, P) by the fitted
    parameters, and ``parameters`` (P, P), what these may be off by: that is shared, by repeats of a command and by all
    commands that meet in a parameter.
    """

    own: Floats
    slopes: Floats
    parameters: Floats

    def select(self, chosen: NDArray[np.bool_]) -> EndSpread:
        """Return those of the runs that a mask chooses."""
        return EndSpread(self.own[chosen], self.slopes[chosen], self.parameters)


def end_spread(every: Predictor, fitted: Fit) -> EndSpread:
    """Return how far the runs of `every` may end from what it predicts with the parameters of `fitted`."""
    readings = every.readings
    linear = every.linearise(fitted.parameters, np.zeros((len(readings), 6)))
    rows = np.arange(len(readings))
    last = readings.seen.shape[1] - 1 - np.argmax(readings.seen[:, ::-1], axis=1)
    turn = np.zeros((len(readings), 3, 3))
    cos, sin = np.cos(readings.start[:, 2]), np.sin(readings.start[:, 2])
    turn[:, 0, 0] = turn[:, 1, 1] = cos
    turn[:, 0, 1], turn[:, 1, 0], turn[:, 2, 2] = sin, -sin, 1.0
    a = turn @ linear.by_random_effects[rows, last]
    j = turn @ linear.by_parameters[rows, last]
    variance_components = fitted.variance_components
    frame = np.diag(
        np.square([variance_components.position_m, variance_components.position_m, variance_components.heading_rad])
    )
    own = (a * priors(every, variance_components)[:, None, :] ** 2) @ a.transpose(0, 2, 1) + frame
    return EndSpread(own, j, fitted.covariance)


QUANTITIES = (
    *("end_position_mm", "along_mm", "across_mm", "delta_heading_deg", "delta_s_mm"),
    *("position_rms_mm", "heading_rms_deg"),
)
"""Errors of the end pose first (along and across in the start frame), then those along the way."""
MEDIAN = "end_position_median_mm"
WITHIN_REPEATABILITY = 1.25
"""A residual is within repeatability up to this factor, or where repeats cannot distinguish it from their variation."""

LACK_OF_FIT = 0.01
"""Groups of repeats differ beyond repeatability below this p-value."""

_FEWEST_WITHIN_DOF = 9
"""Fewer degrees of freedom do not determine the dispersion of repeats."""

_LEAST = 1e-6  # m, rad: less noise than any camera has

_UNITS = {name: 1e3 if name.endswith("_mm") else 180.0 / np.pi for name in QUANTITIES}


@dataclass(frozen=True)
class PoseResiduals:
    """Measured minus predicted.

    ``path`` (R, K, 3) [m, m, rad] in each run's start frame, zero where nothing was ``seen`` (R, K);
    ``delta_s_m`` and ``delta_heading_rad`` (R,) at the end.
    """

    path: Floats
    seen: NDArray[np.bool_]
    delta_s_m: Floats
    delta_heading_rad: Floats

    @property
    def ends(self) -> Floats:
        """Return the residual at the last sample of each run: along, across [m] and heading [rad], shape (R, 3)."""
        last = self.seen.shape[1] - 1 - np.argmax(self.seen[:, ::-1], axis=1)
        return np.asarray(self.path[np.arange(len(self.path)), last])

    def median_mm(self) -> float:
        """Return the median over runs of the end position error [mm]."""
        return 1e3 * float(np.median(np.hypot(*self.ends[:, :2].T)))

    def rms(self) -> dict[str, float]:
        """Return each quantity's root mean square over runs, in the unit of its name."""
        squares = self.squares()
        return {name: _UNITS[name] * float(np.sqrt(np.mean(squares[name]))) for name in QUANTITIES}

    def squares(self) -> Mapping[str, Floats]:
        """Return each quantity's mean square of each run (R,): a run counts once, however long it is."""
        count, ends = np.maximum(self.seen.sum(axis=1), 1), self.ends**2
        return {
            "end_position_mm": ends[:, 0] + ends[:, 1],
            "along_mm": ends[:, 0],
            "across_mm": ends[:, 1],
            "delta_heading_deg": self.delta_heading_rad**2,
            "delta_s_mm": self.delta_s_m**2,
            "position_rms_mm": np.sum(self.path[..., :2] ** 2, axis=(1, 2)) / count,
            "heading_rms_deg": np.sum(self.path[..., 2] ** 2, axis=1) / count,
        }


def pose_residuals(readings: Readings, poses: Floats) -> PoseResiduals:
    """Return what predicted `poses` (R, K, 3) miss."""
    seen = readings.seen
    difference = np.where(seen[..., None], readings.poses - poses, 0.0)
    cos, sin = np.cos(readings.start[:, 2])[:, None], np.sin(readings.start[:, 2])[:, None]
    path = np.stack(
        [
            cos * difference[..., 0] + sin * difference[..., 1],
            cos * difference[..., 1] - sin * difference[..., 0],
            difference[..., 2],
        ],
        axis=-1,
    )
    rows = np.arange(len(readings))
    last = seen.shape[1] - 1 - np.argmax(seen[:, ::-1], axis=1)
    went = np.hypot(*(readings.poses[rows, last, :2] - readings.start[:, :2]).T)
    predicted = np.hypot(*(poses[rows, last, :2] - readings.start[:, :2]).T)
    return PoseResiduals(path, seen, went - predicted, path[rows, last, 2])


def repeatability(residuals: PoseResiduals, group: NDArray[np.int64]) -> dict[str, float] | None:
    """Return the root mean square between repeats, to compare with `PoseResiduals.rms`; None without repeats.

    What repeats of one command have in common is the model's to predict; what differs between them is not. Taken
    from the residuals of the *final* model, so that a cause that depends on place or time does not pass for noise.
    Groups whose dispersion is beyond four times the median's (one bad run) count as that. `MEDIAN` is the median over
    runs of the distance between end positions and their group's mean.
    """
    per_group: dict[str, list[tuple[float, float]]] = {name: [] for name in QUANTITIES}
    apart_mm: list[float] = []
    ends = residuals.ends
    for g in np.unique(group):
        own = np.flatnonzero(group == g)
        if len(own) < 2:
            continue
        both = residuals.seen[own].all(axis=0)
        path = residuals.path[own][:, both]
        off = path - path.mean(axis=0)
        dof = len(own) - 1.0
        # Distances from a mean of n are too short by √(1 − 1/n).
        apart = (ends[own] - ends[own].mean(axis=0)) * np.sqrt(len(own) / dof)
        apart_mm += (1e3 * np.hypot(*apart[:, :2].T)).tolist()
        along, across = np.var(ends[own, :2], axis=0, ddof=1).tolist()
        values = {
            "end_position_mm": along + across,
            "along_mm": along,
            "across_mm": across,
            "position_rms_mm": float(np.sum(off[..., :2] ** 2)) / dof / max(int(both.sum()), 1),
            "heading_rms_deg": float(np.sum(off[..., 2] ** 2)) / dof / max(int(both.sum()), 1),
            "delta_s_mm": float(np.var(residuals.delta_s_m[own], ddof=1)),
            "delta_heading_deg": float(np.var(residuals.delta_heading_rad[own], ddof=1)),
        }
        for name, value in values.items():
            per_group[name].append((value, len(own)))
    if not per_group["position_rms_mm"]:
        return None
    out = {}
    for name, pairs in per_group.items():
        value, runs = np.array(pairs).T
        most = 16.0 * np.median(value)
        out[name] = _UNITS[name] * float(np.sqrt(np.sum(np.minimum(value, most) * runs) / np.sum(runs)))
    return out | {MEDIAN: float(np.median(apart_mm))}


def lack_of_fit(
    residuals: PoseResiduals,
    group: NDArray[np.int64],
    spread: EndSpread | None = None,
    tested: NDArray[np.bool_] | None = None,
) -> float | None:
    """Return a p-value that residuals are the same for all groups of repeats: lack of fit against pure error.

    The unit is the run. From each run come three numbers (where it ended: along, across, heading), in units of how far
    it may end from its prediction by the fitted variance, which is not the same for a straight and a slalom.
    The means of groups may also be off, and together, by what the parameters may be: two commands with a level in
    common share its error, and are not two pieces of evidence. Between and within groups they are compared by F, so
    that the variance itself does not matter. Without `spread` all runs have the same. None without repeats.

    Means are those of the runs `tested` (R,), all by default; the dispersion of repeats about their own mean is known
    from all runs: it does not depend on what their prediction was chosen by.
    """
    from scipy import special

    if tested is None:
        tested = np.ones(len(group), dtype=np.bool_)
    names, index = np.unique(group, return_inverse=True)
    asked, asked_index = np.unique(group[tested], return_inverse=True)
    within_dof, between_dof = 3 * (len(group) - len(names)), 3 * len(asked)
    if within_dof < _FEWEST_WITHIN_DOF or not between_dof:
        return None
    apart = residuals.ends - _by_group(residuals.ends, index)[index]
    spread = spread or _alike(apart, within_dof // 3)
    within = _within(apart, index, spread)
    if within <= 0.0:
        return 1.0
    between = _between(residuals.ends[tested], asked_index, spread.select(tested))
    return float(special.fdtrc(between_dof, within_dof, between / between_dof / (within / within_dof)))


def _alike(apart: Floats, dof: int) -> EndSpread:
    """Return the spread of runs with the same dispersion as those `apart` (R, 3) from their groups' means."""
    runs, covariance = len(apart), apart.T @ apart / dof + np.eye(3) * _LEAST**2
    return EndSpread(np.broadcast_to(covariance, (runs, 3, 3)), np.zeros((runs, 3, 0)), np.zeros((0, 0)))


def _within(apart: Floats, index: NDArray[np.int64], spread: EndSpread) -> float:
    """Return the square of what repeats are `apart` (R, 3) from their group's mean, in units of their spread."""
    own = _by_group(spread.own, index)
    return sum(float(np.sum(_white(own[g], apart[index == g].T) ** 2)) for g in range(len(own)))


def _between(ends: Floats, index: NDArray[np.int64], spread: EndSpread) -> float:
    """Return the square of what groups miss in the mean, in units of what they may."""
    means, own = _by_group(ends, index), _by_group(spread.own, index)
    slopes = _by_group(spread.slopes, index).reshape(means.size, -1)
    shared = slopes @ spread.parameters @ slopes.T
    for g, size in enumerate(np.bincount(index)):
        shared[3 * g : 3 * g + 3, 3 * g : 3 * g + 3] += own[g] / size
    return float(np.sum(_white(shared, means.ravel()) ** 2))


def _by_group(values: Floats, index: NDArray[np.int64]) -> Floats:
    """Return the mean of runs' values (R, …) in each group (G, …)."""
    return np.array([values[index == g].mean(axis=0) for g in range(int(index.max()) + 1)])


def _white(covariance: Floats, values: Floats) -> Floats:
    return np.asarray(np.linalg.solve(np.linalg.cholesky(covariance), values))
