"""Prediction residuals, and the lack-of-fit test.

The same standard deviation of the axle angles causes a ten times larger end position error in a long slalom than in a
short straight. Residuals of groups are therefore compared in units of their predicted standard deviations.
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
class EndCovariance:
    """Covariance of the prediction error at each run's last sample, in its start frame [m, m, rad].

    ``own`` (R, 3, 3): covariance from random effects and frame noise, independent in each repeat; ``slopes``
    (R, 3, P): derivatives by the fitted parameters; ``parameters`` (P, P): covariance of these, shared by all runs that
    depend on a parameter.
    """

    own: Floats
    slopes: Floats
    parameters: Floats

    def select(self, chosen: NDArray[np.bool_]) -> EndCovariance:
        """Return the covariances of the runs that a mask selects."""
        return EndCovariance(self.own[chosen], self.slopes[chosen], self.parameters)


def end_covariance(every: Predictor, fitted: Fit) -> EndCovariance:
    """Return the covariance of the end poses of the runs of `every`, with the parameters of `fitted`."""
    readings = every.readings
    linear = every.linearise(fitted.parameters, every.no_random_effects())
    rows = np.arange(len(readings))
    last = readings.seen.shape[1] - 1 - np.argmax(readings.seen[:, ::-1], axis=1)
    rotation = np.zeros((len(readings), 3, 3))
    cos, sin = np.cos(readings.start[:, 2]), np.sin(readings.start[:, 2])
    rotation[:, 0, 0] = rotation[:, 1, 1] = cos
    rotation[:, 0, 1], rotation[:, 1, 0], rotation[:, 2, 2] = sin, -sin, 1.0
    a = rotation @ linear.by_random_effects[rows, last]
    j = rotation @ linear.by_parameters[rows, last]
    variance_components = fitted.variance_components
    frame = np.diag(
        np.square([variance_components.position_m, variance_components.position_m, variance_components.heading_rad])
    )
    own = (a * priors(every, variance_components)[:, None, :] ** 2) @ a.transpose(0, 2, 1) + frame
    return EndCovariance(own, j, fitted.covariance)


QUANTITIES = (
    *("end_position_mm", "along_mm", "across_mm", "delta_heading_deg", "delta_s_mm"),
    *("position_rms_mm", "heading_rms_deg"),
)
"""Errors of the end pose (along and across in the start frame), then errors over the whole path."""
MEDIAN = "end_position_median_mm"
_MIN_WITHIN_DOF = 9
"""Smallest number of degrees of freedom for the standard deviation of repeats."""

_MIN_DEVIATION = 1e-6  # m, rad: below the noise of any camera

UNITS = {name: 1e3 if name.endswith("_mm") else 180.0 / np.pi for name in QUANTITIES}


@dataclass(frozen=True)
class PoseResiduals:
    """Residuals: measured minus predicted.

    ``path`` (R, K, 3) [m, m, rad] in each run's start frame, zero where no pose was ``seen`` (R, K);
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
        return {name: UNITS[name] * float(np.sqrt(np.mean(squares[name]))) for name in QUANTITIES}

    def exceed(self, spread: Mapping[str, float], multiple: float) -> bool:
        """Return whether position or heading along the path exceeds a multiple of the spread of repeats."""
        own = self.rms()
        return any(own[name] > multiple * spread[name] for name in ("position_rms_mm", "heading_rms_deg"))

    def squares(self) -> Mapping[str, Floats]:
        """Return each quantity's mean square of each run (R,): runs have equal weights, whatever their length."""
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
    """Return the residuals of predicted `poses` (R, K, 3)."""
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
    measured = np.hypot(*(readings.poses[rows, last, :2] - readings.start[:, :2]).T)
    predicted = np.hypot(*(poses[rows, last, :2] - readings.start[:, :2]).T)
    return PoseResiduals(path, seen, measured - predicted, path[rows, last, 2])


def lack_of_fit(
    residuals: PoseResiduals,
    group: NDArray[np.int64],
    covariance: EndCovariance | None = None,
    tested: NDArray[np.bool_] | None = None,
) -> float | None:
    """Return the p-value of the lack-of-fit test: residuals of groups against pure error between repeats.

    The unit is the run. Each run contributes three numbers, the residual of its end pose (along, across, heading), in
    units of its predicted standard deviations, which differ between a straight and a slalom. Errors of the parameters
    shift the means of all groups that depend on them: two commands with a common level share its error, and are not
    independent. F compares the mean squares between and within groups, so that the size of the variance components
    does not matter. Without `covariance` all runs have equal covariances. Return None without repeats.

    The means between groups are those of the runs `tested` (R,), by default all. The deviations within groups come from
    all runs: they do not depend on how the model was selected.
    """
    from scipy import special

    if tested is None:
        tested = np.ones(len(group), dtype=np.bool_)
    names, index = np.unique(group, return_inverse=True)
    tested_names, tested_index = np.unique(group[tested], return_inverse=True)
    within_dof, between_dof = 3 * (len(group) - len(names)), 3 * len(tested_names)
    if within_dof < _MIN_WITHIN_DOF or not between_dof:
        return None
    deviation = residuals.ends - group_means(residuals.ends, index)[index]
    covariance = covariance or _equal_covariance(deviation, within_dof // 3)
    within = _within(deviation, index, covariance)
    if within <= 0.0:
        return 1.0
    between = _between(residuals.ends[tested], tested_index, covariance.select(tested))
    return float(special.fdtrc(between_dof, within_dof, between / between_dof / (within / within_dof)))


def _equal_covariance(deviation: Floats, dof: int) -> EndCovariance:
    """Return the pooled covariance of deviations (R, 3) from group means, the same for all runs."""
    runs, covariance = len(deviation), deviation.T @ deviation / dof + np.eye(3) * _MIN_DEVIATION**2
    return EndCovariance(np.broadcast_to(covariance, (runs, 3, 3)), np.zeros((runs, 3, 0)), np.zeros((0, 0)))


def _within(deviation: Floats, index: NDArray[np.int64], covariance: EndCovariance) -> float:
    """Return the whitened sum of squares within groups, of deviations (R, 3) from group means."""
    own = group_means(covariance.own, index)
    return sum(float(np.sum(_whitened(own[g], deviation[index == g].T) ** 2)) for g in range(len(own)))


def _between(ends: Floats, index: NDArray[np.int64], covariance: EndCovariance) -> float:
    """Return the whitened sum of squares between groups, of their mean residuals."""
    means, own = group_means(ends, index), group_means(covariance.own, index)
    slopes = group_means(covariance.slopes, index).reshape(means.size, -1)
    shared = slopes @ covariance.parameters @ slopes.T
    for g, size in enumerate(np.bincount(index)):
        shared[3 * g : 3 * g + 3, 3 * g : 3 * g + 3] += own[g] / size
    return float(np.sum(_whitened(shared, means.ravel()) ** 2))


def group_means(values: Floats, index: NDArray[np.int64]) -> Floats:
    """Return the mean of runs' values (R, …) in each group (G, …)."""
    return np.array([values[index == g].mean(axis=0) for g in range(int(index.max()) + 1)])


def _whitened(covariance: Floats, values: Floats) -> Floats:
    return np.asarray(np.linalg.solve(np.linalg.cholesky(covariance), values))
