"""Effects' parameters by maximum likelihood, with the initial pose of every run free and the noise known.

Initial poses are many and each touches its own run alone: they are solved for run by run within each step (variable
projection, Golub and Pereyra, 1973), and what is left are equations in the parameters, whose matrix is the Fisher
information with the initial poses marginalised. Slopes cost one simulation per parameter; once steps are small beside
what noise allows, they are kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from agvbench.errors import FitError, InputError
from agvbench.model.simulation.simulation import Simulation
from agvbench.types import Floats

_MOST_STEPS = 30
_SHARE = 1e-3
_HALVINGS = 6
_KEEP_SLOPES = 100.0
_DONE = 1e-4
_WEAK = 1e-12
_FIRST = 0.1


@dataclass(frozen=True)
class PoseNoise:
    """Standard deviations of a frame: ``position_m`` [m] each way, and ``heading_rad`` [rad]."""

    position_m: float
    heading_rad: float

    def __post_init__(self) -> None:
        for what, value in vars(self).items():
            if not (np.isfinite(value) and value > 0.0):
                raise InputError("must be greater than zero", where=what, value=f"{value:g}")


@dataclass(frozen=True)
class Identification:
    """What frames say about parameters.

    ``names`` and ``values`` (p,) of the parameters in the registry's order, their ``fisher`` information (p, p) with
    initial poses marginalised; ``initial`` (runs, 3) poses; ``chi_squared`` of ``frames`` frames; ``steps`` taken.
    """

    names: tuple[str, ...]
    values: Floats
    fisher: Floats
    initial: Floats
    chi_squared: float
    frames: int
    steps: int

    @property
    def covariance(self) -> Floats:
        """The parameters' covariance (p, p), to first order."""
        return np.asarray(np.linalg.inv(self.fisher))

    @property
    def stderr(self) -> Floats:
        """Standard errors (p,)."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance)))


def identify(
    simulation: Simulation,
    settled: Floats,
    observed: Floats,
    noise: PoseNoise,
    *,
    effects: Sequence[str],
    start: Floats | None = None,
) -> Identification:
    """Return the most likely parameters of `effects`, all else as it is in `start`.

    Parameters
    ----------
    simulation
        The runs; F frames in all.
    settled
        (rows, 3) settled angles and speed of every row, see `Simulation.settled`.
    observed
        (F, 3) measured x, y [m] and heading [rad]; a frame with a NaN does not count. Headings may jump by 2π.
    noise
        Known standard deviations.
    effects
        Names of the effects whose parameters are free.
    start
        (p_all,) the simulation's parameter vector to begin from; by default a tenth of each parameter's scale.

    Raises
    ------
    InputError
        If `observed` does not fit the simulation's frames, or a run has fewer than two that count.
    FitError
        If the frames do not determine the parameters, or no step helps.
    """
    problem = _IdentificationProblem(simulation, settled, observed, noise, effects)
    values = problem.first() if start is None else np.array(start, dtype=np.float64)
    initial = problem.first_poses()
    state = problem.at(values, initial)
    slopes = problem.slopes(values, initial, state.poses)
    for step in range(1, _MOST_STEPS + 1):
        normal = problem.normal(state, slopes)
        move = _solved(normal.matrix, normal.pull)
        decrement = float(move @ normal.pull)
        state, share = problem.moved(state, normal, move)
        if share == 1.0 and decrement < _DONE * len(move):
            return problem.result(state, normal, step)
        if share == 0.0:
            # Frozen slopes may have led nowhere; with fresh ones, nowhere is where it ends.
            if decrement < 1.0:
                return problem.result(state, normal, step)
            raise FitError("no step brings the prediction nearer", where=", ".join(effects), value=f"{decrement:.3g}")
        if decrement > _KEEP_SLOPES:
            slopes = problem.slopes(state.values, state.initial, state.poses)
    raise FitError("did not come to rest", where=", ".join(effects), value=f"{_MOST_STEPS} steps")


@dataclass(frozen=True)
class _Iterate:
    values: Floats
    initial: Floats
    poses: Floats
    residual: Floats
    chi_squared: float


@dataclass(frozen=True)
class _Normal:
    matrix: Floats
    pull: Floats
    inner: Floats
    mixed: Floats
    inner_pull: Floats


class _IdentificationProblem:
    def __init__(
        self, simulation: Simulation, settled: Floats, observed: Floats, noise: PoseNoise, effects: Sequence[str]
    ) -> None:
        self.simulation, self.settled = simulation, settled
        frames = len(simulation.t_s)
        if observed.shape != (frames, 3):
            raise InputError("does not fit the frames", where="observed", value=observed.shape, limit=(frames, 3))
        unknown = [name for name in effects if not len(simulation.indices(name))]
        if unknown or not effects:
            raise InputError("no such effect", where="effects", value=", ".join(unknown) or "none given")
        self.own = simulation.indices(*effects)
        self.seen = np.asarray(np.isfinite(observed).all(axis=1))
        self.observed = np.where(self.seen[:, None], observed, 0.0)
        self.weight = self.seen[:, None] / np.array([noise.position_m, noise.position_m, noise.heading_rad])
        self.spans = list(pairwise(simulation.frame_starts.tolist()))
        few = [i for i, (a, b) in enumerate(self.spans) if np.count_nonzero(self.seen[a:b]) < 2]
        if few:
            raise InputError("a run needs two frames that count", where="observed", value=f"run {few[0]}")

    def first(self) -> Floats:
        """Return a tenth of each free parameter's scale, all else at null; limits begin at ten times theirs."""
        s = self.simulation
        out = s.nulls.copy()
        finite = np.isfinite(s.nulls[self.own])
        begin = np.where(finite, _FIRST * s.scales[self.own], s.scales[self.own] / _FIRST)
        out[self.own] = np.clip(begin, s.lower[self.own], s.upper[self.own])
        return out

    def first_poses(self) -> Floats:
        """Return each run's first frame that counts."""
        return np.array([self.observed[a:b][int(np.argmax(self.seen[a:b]))] for a, b in self.spans])

    def predict(self, values: Floats, initial: Floats) -> Floats:
        """Return the poses (F, 3) from rest at `initial` (runs, 3)."""
        return self.simulation.predict(self.settled, values, np.column_stack([initial, np.zeros(len(initial))]))

    def at(self, values: Floats, initial: Floats) -> _Iterate:
        """Return prediction and misfit."""
        poses = self.predict(values, initial)
        off = self.observed - poses
        off[:, 2] -= 2.0 * np.pi * np.round(off[:, 2] / (2.0 * np.pi))
        residual = off * self.weight
        return _Iterate(values, initial, poses, residual, float(np.sum(residual**2)))

    def slopes(self, values: Floats, initial: Floats, poses: Floats) -> Floats:
        """Return weighted derivatives (F, 3, p + 3): by the parameters, and by the run's initial x, y and heading."""
        s = self.simulation
        p = len(self.own)
        out = np.zeros((len(poses), 3, p + 3))
        for k, i in enumerate(self.own):
            step = _SHARE * s.scales[i]
            step = -step if values[i] + step > s.upper[i] else step
            changed = values.copy()
            changed[i] += step
            out[..., k] = (self.predict(changed, initial) - poses) / step
        away = poses[:, :2] - initial[s.frame_runs, :2]
        out[:, 0, p] = out[:, 1, p + 1] = out[:, 2, p + 2] = 1.0
        out[:, 0, p + 2], out[:, 1, p + 2] = -away[:, 1], away[:, 0]
        out *= self.weight[..., None]
        return out

    def normal(self, state: _Iterate, slopes: Floats) -> _Normal:
        """Return the equations in the parameters, initial poses solved for."""
        p = len(self.own)
        runs = len(self.spans)
        inner, mixed, inner_pull = np.empty((runs, 3, 3)), np.empty((runs, 3, p)), np.empty((runs, 3))
        matrix, pull = np.zeros((p, p)), np.zeros(p)
        for r, (a, b) in enumerate(self.spans):
            j = slopes[a:b].reshape(-1, p + 3)
            gram, towards = j.T @ j, j.T @ state.residual[a:b].ravel()
            inner[r], mixed[r], inner_pull[r] = gram[p:, p:], gram[p:, :p], towards[p:]
            solved = np.linalg.solve(inner[r], np.column_stack([mixed[r], inner_pull[r]]))
            matrix += gram[:p, :p] - mixed[r].T @ solved[:, :p]
            pull += towards[:p] - mixed[r].T @ solved[:, p]
        return _Normal(matrix, pull, inner, mixed, inner_pull)

    def moved(self, state: _Iterate, normal: _Normal, move: Floats) -> tuple[_Iterate, float]:
        """Return the state after as much of a step as helps, and that share; initial poses follow along."""
        s = self.simulation
        poses = np.linalg.solve(normal.inner, (normal.inner_pull - normal.mixed @ move)[..., None])[..., 0]
        share = 1.0
        for _ in range(_HALVINGS):
            values = state.values.copy()
            values[self.own] = np.clip(values[self.own] + share * move, s.lower[self.own], s.upper[self.own])
            new = self.at(values, state.initial + share * poses)
            if new.chi_squared <= state.chi_squared * (1.0 + 1e-12):
                return new, share
            share *= 0.4
        return state, 0.0

    def result(self, state: _Iterate, normal: _Normal, steps: int) -> Identification:
        """Return what was found."""
        return Identification(
            tuple(self.simulation.parameter_names[i] for i in self.own),
            state.values[self.own],
            normal.matrix,
            state.initial,
            state.chi_squared,
            int(np.count_nonzero(self.seen)),
            steps,
        )


def _solved(matrix: Floats, pull: Floats) -> Floats:
    scale = np.sqrt(np.diagonal(matrix))
    if not np.all(scale > 0.0):
        raise FitError("a parameter changes nothing in these runs", value=f"number {int(np.argmin(scale))}")
    even = matrix / scale[:, None] / scale[None, :]
    if np.linalg.cond(even) > 1.0 / _WEAK:
        raise FitError("the frames do not identify the parameters", value=f"condition {np.linalg.cond(even):.1e}")
    return np.asarray(np.linalg.solve(even, pull / scale) / scale)
