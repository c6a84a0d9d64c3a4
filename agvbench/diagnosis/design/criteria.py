"""Design criteria: expected evidence between models, and expected standard errors, with the data at hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.readings import SAMPLES, Readings
from agvbench.diagnosis.design.designs import Design
from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.estimation.variance import EVIDENCE_POSES
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.planning.workspace import Workspace
from agvbench.types import NO_TARGET, Floats, Frames, Pose, Run
from agvbench.vehicle.geometry import Geometry

HEADINGS_RAD = (0.0, 0.5 * np.pi, np.pi, 1.5 * np.pi)
"""Start headings of repeats in turn, so that effects of the floor differ between them."""

_AFTER_S = 0.8
_START_M, _START_RAD = 3e-4, 5e-4
_WEAK = 1e-6


@dataclass(frozen=True)
class DesignInformation:
    """Information of runs of D designs about parameters, with random effects integrated out: ``matrix`` (D, P, P).

    ``pull`` (D, P) and ``square`` (D,) are the gradient and the squared norm of a difference between predictions, if
    one was given.
    """

    matrix: Floats
    pull: Floats
    square: Floats


def simulated_readings(designs: Sequence[Design], starts: Sequence[Sequence[Pose]], noise: Floats) -> Readings:
    """Return simulated runs of `designs`, one from each of their `starts`; `noise` (3,) is that of the start poses.

    All designs have equally many starts; the runs of a design are consecutive.
    """
    runs, t_s = [], []
    for design in designs:
        commands = design.commands()
        runs += [_run(commands, k) for k in range(len(starts[0]))]
        t_s += [np.linspace(0.1, design.duration_s + _AFTER_S, SAMPLES)] * len(starts[0])
    start = np.array([pose for own in starts for pose in own], dtype=np.float64)
    return Readings(
        runs=tuple(runs),
        t_s=np.array(t_s),
        poses=np.zeros((len(runs), SAMPLES, 3)),
        start=start,
        start_stderr=np.broadcast_to(noise, start.shape).copy(),
        started_h=np.zeros(len(runs)),
        group=np.repeat(np.arange(len(designs)), len(starts[0])),
        refused={},
    )


def _run(commands: object, repeat: int) -> Run:
    return Run("", "free", "", "calibrated", repeat, NO_TARGET, 0.0, "ok", "", commands, Frames.empty())  # type: ignore[arg-type]


def batch_like(fitted: Fit, readings: Readings, geometry: Geometry) -> Batch:
    """Return other runs packed for `fitted`, and for models with other effects."""
    return Batch(readings, fitted.predictor.maps, geometry, kinds=fitted.predictor.batch.kinds)


def predictor_like(fitted: Fit, readings: Readings, geometry: Geometry) -> Predictor:
    """Return the predictor of other runs with the maps and effects of `fitted`."""
    return Predictor(batch_like(fitted, readings, geometry), fitted.predictor.effects)


def starts_within(path: Floats, workspace: Workspace, geometry: Geometry) -> list[Pose] | None:
    """Return a start pose for each heading of `HEADINGS_RAD` that centres `path` (n, 3) on the floor.

    None if the path does not fit on the floor, or is not finite. The path begins at the origin, along x.
    """
    if not np.isfinite(path).all():
        return None
    middle = 0.5 * (path[:, :2].min(axis=0) + path[:, :2].max(axis=0))
    radius = float(np.hypot(*(path[:, :2] - middle).T).max()) + max(geometry.front_axle_m, geometry.rear_axle_m)
    centre = np.asarray(workspace.centre)
    if radius > float(workspace.clearances(centre[None, :]).min()) - workspace.margin_m:
        return None
    out = []
    for heading in HEADINGS_RAD:
        cos, sin = np.cos(heading), np.sin(heading)
        out.append(
            Pose(
                float(centre[0] - cos * middle[0] + sin * middle[1]),
                float(centre[1] - sin * middle[0] - cos * middle[1]),
                float(np.mod(heading + np.pi, 2.0 * np.pi) - np.pi),
            )
        )
    return out


def information(
    fitted: Fit, predictor: Predictor, parameters: Floats, difference: Floats | None = None
) -> DesignInformation:
    """Return the information of the runs of `predictor` about `parameters`, with the variance components of `fitted`.

    ``difference`` (R, K, 3), if given, is the difference to the prediction of another model.
    """
    readings = predictor.readings
    linear = predictor.linearise(parameters, predictor.no_random_effects())
    seen = np.ones(readings.t_s.shape, dtype=np.bool_)
    weighted = Weighted(readings, seen, linear.by_random_effects, fitted)
    e = weighted.column(np.zeros_like(linear.poses) if difference is None else difference)
    j = weighted.columns(linear.by_parameters)
    projected, projected_error = weighted.without_random_effects(j), weighted.without_random_effects(e[..., None])
    jt = j.transpose(0, 2, 1)
    parts = (jt @ projected, (jt @ projected_error)[..., 0], np.sum(e * projected_error[..., 0], axis=1))
    sizes = np.bincount(readings.group)
    first = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    return DesignInformation(*(np.add.reduceat(part, first, axis=0) / sizes[0] for part in parts))


class Weighted:
    """Weights samples of runs by their noise, and integrates random effects out.

    The variance components and the priors of the random effects are those of `fitted`.
    """

    def __init__(self, readings: Readings, seen: NDArray[np.bool_], by_random_effects: Floats, fitted: Fit) -> None:
        variance_components = fitted.variance_components
        count = np.maximum(seen.sum(axis=1), 1)
        temper = np.sqrt(np.minimum(1.0, EVIDENCE_POSES / count))
        sd = np.array([variance_components.position_m, variance_components.position_m, variance_components.heading_rad])
        self._weight = temper[:, None, None] * seen[..., None] / sd
        count = by_random_effects.shape[-1]
        prior = np.empty((len(readings), count))
        prior[:, :2] = np.hypot(readings.start_stderr[:, :2], _START_M)
        prior[:, 2:] = variance_components.random_effects[: count - 2]
        prior[:, 2] = np.hypot(readings.start_stderr[:, 2], np.hypot(prior[:, 2], _START_RAD))
        self._a = self.columns(by_random_effects)
        inner = self._a.transpose(0, 2, 1) @ self._a
        inner[:, range(count), range(count)] += prior**-2.0
        self._inverse = np.linalg.inv(inner)

    def column(self, values: Floats) -> Floats:
        """Return values (R, K, 3) over their standard deviations, (R, 3 K)."""
        return np.asarray((values * self._weight).reshape(len(values), -1))

    def columns(self, values: Floats) -> Floats:
        """Return values (R, K, 3, q) over their standard deviations, (R, 3 K, q)."""
        return np.asarray((values * self._weight[..., None]).reshape(len(values), -1, values.shape[-1]))

    def without_random_effects(self, columns: Floats) -> Floats:
        """Return columns (R, 3 K, q) times the inverse covariance of noise and random effects."""
        return np.asarray(columns - self._a @ (self._inverse @ (self._a.transpose(0, 2, 1) @ columns)))


def evidence(known: Floats, new: DesignInformation, repeats: float) -> Floats:
    """Return the expected increase (D,) of minus two log likelihood of the wrong model, after it was refitted.

    ``known`` (P, P) is the information of the data at hand about its parameters.
    """
    matrix = known + repeats * new.matrix
    matrix = matrix + _WEAK * np.eye(matrix.shape[-1])
    move = np.linalg.solve(matrix, repeats * new.pull[..., None])[..., 0]
    return np.asarray(repeats * new.square - np.sum(repeats * new.pull * move, axis=1))
