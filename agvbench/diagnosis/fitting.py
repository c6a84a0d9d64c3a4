"""Free maps and effects fitted together, with what differs from run to run integrated out.

Each run has its own start pose, an offset of each axle and a factor on its speed, drawn about zero with a scatter that
is estimated, too. Without them a run's frames would pass for as many pieces of evidence, and the smallest play in a
servo for an effect. They are found anew about every prediction (not once about zero), and enter the
likelihood by Laplace's approximation.

Windows of free driving have no offsets but those of their start pose: what one window misses its neighbours miss, too,
so that an offset for each would explain a cause away. Their errors grow with time and have heavy tails, another day's
driving being many times as far off as this one's: the likelihood is Student's, of a window and not of its samples.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from agvbench.diagnosis.prediction import Linearised, Predictor
from agvbench.diagnosis.reading import Readings
from agvbench.types import Floats

EVIDENCE_POSES = 4.0
"""A run's samples count as this many independent poses: what a model misses at one time it misses at the next."""

_ITERATIONS = 8
_HALVINGS = 4
_DAMPINGS = (0.0, 0.1, 3.0)
_LEAST_M, _LEAST_RAD = 1e-4, 2e-4
_START_EXTRA_M = 2e-4
_LEAST_SCATTER = np.array([2e-4, 2e-4, 2e-4, 2e-4])
_ENOUGH = 0.05
_CLOSE = 1.0
_WEAK = 1e-4
_TAIL = 4.0  # degrees of freedom of a window's errors


@dataclass(frozen=True)
class Scatter:
    """Standard deviations.

    Within a run ``position_m`` and ``heading_rad``; from run to run ``offsets`` (4,): start heading [rad], front and
    rear axle [rad], log of speed. ``growth`` (K,) or (1,): how large errors of each sample are beside those.
    """

    position_m: float
    heading_rad: float
    offsets: Floats
    growth: Floats = field(default_factory=lambda: np.ones(1))


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    ``parameters`` (P,), the maps' values first; ``offsets`` (R, 6) of each run; ``scatter``; ``loss`` (R,): minus two
    log likelihood of each run; ``information`` (R, P, P) and ``gradient`` (R, P): its quadratic form about them;
    ``residual`` (R, K, 3): measured minus predicted with the offsets.
    """

    predictor: Predictor
    parameters: Floats
    offsets: Floats
    scatter: Scatter
    loss: Floats
    information: Floats
    gradient: Floats
    residual: Floats
    linear: Linearised

    @property
    def covariance(self) -> Floats:
        """Covariance of the parameters (P, P)."""
        return np.asarray(np.linalg.pinv(self.information.sum(axis=0) + _ridge(self.predictor), hermitian=True))

    @cached_property
    def ground(self) -> _Ground:
        """What every promise of a larger model starts from."""
        return _Ground.of(self)

    def effect_values(self) -> dict[str, float]:
        """Return the effects' parameters by name."""
        own = self.parameters[self.predictor.maps.size :]
        return dict(zip(self.predictor.parameter_names, own.tolist(), strict=True))


@dataclass(frozen=True)
class _Terms:
    loss: Floats
    information: Floats
    gradient: Floats
    inner_inverse: Floats
    mixed: Floats
    pull: Floats


@dataclass(frozen=True)
class _Ground:
    """A fitted model of runs as larger ones are linearised about it, with the runs' offsets projected out.

    ``weight`` (R, K, 3) of residuals; ``a`` (R, 3K, 6) derivatives by the offsets, ``inverse`` (R, 6, 6) of their
    information, ``drawn`` (R, 6) what their prior pulls; ``j`` (3 R K, P) derivatives by the parameters, projected;
    ``covariance`` (P, P); ``pull`` (P,) of the offsets' prior on the parameters.
    """

    weight: Floats
    a: Floats
    inverse: Floats
    drawn: Floats
    j: Floats
    covariance: Floats
    pull: Floats

    @classmethod
    def of(cls, fitted: Fit) -> _Ground:
        """Return the ground of a fit."""
        predictor, scatter, offsets = fitted.predictor, fitted.scatter, fitted.offsets
        weight = _weights(predictor, scatter)
        runs = len(offsets)
        a = (fitted.linear.by_offsets * weight[..., None]).reshape(runs, -1, 6)
        j = (fitted.linear.by_parameters * weight[..., None]).reshape(runs, a.shape[1], -1)
        prior = priors(predictor, scatter)
        inverse = _inner_inverse(a, prior)[1]
        mixed = inverse @ (a.transpose(0, 2, 1) @ j)
        drawn = offsets / prior**2
        matrix = fitted.information.sum(axis=0) + _ridge(predictor)
        projected = (j - a @ mixed).reshape(-1, j.shape[-1])
        covariance = np.asarray(np.linalg.inv(matrix))
        return cls(weight, a, inverse, drawn, projected, covariance, np.einsum("rij,ri->j", mixed, drawn))

    def square(self, e: Floats) -> float:
        """Return the weighted squares of residuals `e` (R, 3K), their offsets found anew."""
        pull = np.einsum("rni,rn->ri", self.a, e) - self.drawn
        return float(np.sum(e * e) - np.einsum("ri,rij,rj->", pull, self.inverse, pull, optimize=True))

    def promise(self, residual: Floats, before: Floats, slopes: Floats, start: Floats, bounds: Floats) -> float:
        """Return by how much the loss falls, to first order, from residuals `before` by `residual` and its `slopes`."""
        e = (residual * self.weight).reshape(len(residual), -1)
        new = (slopes * self.weight[..., None]).reshape(*e.shape, -1)
        fixed = new - self.a @ (self.inverse @ (self.a.transpose(0, 2, 1) @ new))
        pull = np.einsum("rnq,rn->q", fixed, e)
        pull += np.einsum("rnq,rni,rij,rj->q", new, self.a, self.inverse, self.drawn, optimize=True)
        old_pull = self.j.T @ e.ravel() + self.pull
        shared = self.j.T @ new.reshape(len(self.j), -1)
        own = np.einsum("rnp,rnq->pq", new, fixed) + _WEAK * np.eye(len(start))
        # The maps and effects that there are move along; what is left is a question of the new parameters alone.
        along = self.covariance @ shared
        matrix, rest = own - shared.T @ along, pull - along.T @ old_pull
        wanted = start + np.linalg.lstsq(matrix, rest, rcond=1e-12)[0]
        move = np.clip(wanted, bounds[:, 0], bounds[:, 1]) - start
        saved = old_pull @ self.covariance @ old_pull + 2.0 * rest @ move - move @ matrix @ move
        was = (before * self.weight).reshape(len(residual), -1)
        return float(self.square(was) - self.square(e) + saved)


def first_scatter() -> Scatter:
    """Return a generous scatter to start from."""
    return Scatter(0.05, 0.05, np.array([0.01, 0.01, 0.01, 0.02]))


def fit(
    predictor: Predictor,
    parameters: Floats,
    bounds: Floats,
    *,
    offsets: Floats | None = None,
    scatter: Scatter | None = None,
    iterations: int = _ITERATIONS,
    near: Linearised | None = None,
) -> Fit:
    """Fit by Gauss–Newton with halved steps, the scatter by expectation maximisation between steps.

    Parameters
    ----------
    predictor
        Runs, maps and effects.
    parameters
        (P,) where to start.
    bounds
        (effects' parameters, 2): lowest and highest value of each.
    offsets, scatter
        Where to start; by default none and generous.
    iterations
        At most this many steps.
    near
        Derivatives of the same maps at parameters close by. By far the most time goes into those by the maps' values,
        and they change little: the first steps are taken with these, the last ones and the result with one's own.
    """
    readings = predictor.readings
    offsets = np.zeros((len(readings), 6)) if offsets is None else offsets.copy()
    scatter = scatter or (first_scatter() if predictor.readings.begins is None else _scatter_of_windows(readings))
    parameters = parameters.copy()
    before = np.inf
    for step in range(iterations):
        linear = predictor.linearise(parameters, offsets, near)
        residual = _residual(predictor, linear.poses)
        terms = _terms(predictor, residual, linear.by_parameters, linear.by_offsets, offsets, scatter)
        parameters, offsets, residual = _step(predictor, parameters, offsets, residual, terms, scatter, bounds)
        scatter = _rescatter(predictor, residual, offsets, terms.inner_inverse, scatter)
        after = float(terms.loss.sum())
        if near is not None and (before - after < _CLOSE or step >= iterations // 2):
            near = None
        elif abs(before - after) < _ENOUGH:
            break
        before = after
    linear = predictor.linearise(parameters, offsets)
    residual = _residual(predictor, linear.poses)
    terms = _terms(predictor, residual, linear.by_parameters, linear.by_offsets, offsets, scatter)
    return Fit(predictor, parameters, offsets, scatter, terms.loss, terms.information, terms.gradient, residual, linear)


def promised_gain(fitted: Fit, larger: Predictor, start: Floats, bounds: Floats) -> float:
    """Return by how much the loss would fall with more effects, their parameters near `start`, to first order.

    `larger` has the effects of `fitted` and then others. It is linearised at `start`, with the derivatives by what
    was fitted before left as they are: some simulations in place of a fit.
    """
    parameters = np.r_[fitted.parameters, start]
    poses, slopes = larger.by_last(parameters, fitted.offsets, len(start))
    residual = _residual(larger, poses)
    if larger.readings.begins is None:
        return fitted.ground.promise(residual, fitted.residual, slopes, start, bounds)
    by_parameters = np.concatenate([fitted.linear.by_parameters, slopes], axis=-1)
    terms = _terms(larger, residual, by_parameters, fitted.linear.by_offsets, fitted.offsets, fitted.scatter)
    gradient, matrix = terms.gradient.sum(axis=0), terms.information.sum(axis=0) + _ridge(larger)
    move = np.linalg.lstsq(matrix, gradient, rcond=1e-12)[0]
    # What would go beyond its bound stops there, and the rest is solved for again.
    known = len(fitted.parameters)
    ends = np.clip(start + move[known:], bounds[:, 0], bounds[:, 1])
    if np.any(ends != start + move[known:]):
        held = np.r_[np.zeros(known), ends - start]
        rest = np.linalg.lstsq(matrix[:known, :known], (gradient - matrix @ held)[:known], rcond=1e-12)[0]
        move = np.r_[rest, ends - start]
    saved = 2.0 * gradient @ move - move @ matrix @ move
    return float(fitted.loss.sum() - terms.loss.sum() + saved)


def loss_at(fitted: Fit, parameters: Floats) -> Floats:
    """Return each run's loss (R,) at other parameters, by simulation, with the scatter of `fitted`."""
    predictor = fitted.predictor
    residual = _residual(predictor, predictor.predict(parameters, fitted.offsets))
    none = fitted.linear.by_parameters[..., :0]
    return _terms(predictor, residual, none, fitted.linear.by_offsets, fitted.offsets, fitted.scatter).loss


def _residual(predictor: Predictor, poses: Floats) -> Floats:
    return np.asarray(np.nan_to_num(predictor.readings.poses - poses))


def _temper(predictor: Predictor) -> tuple[Floats, Floats]:
    count = predictor.readings.seen.sum(axis=1).astype(np.float64)
    evidence = EVIDENCE_POSES if predictor.readings.begins is None else 1.0 / predictor.batch.redundancy
    return np.minimum(1.0, evidence / np.maximum(count, 1.0)), count


def _scale(scatter: Scatter) -> Floats:
    """Return the standard deviation of each sample's error, (K or 1, 3)."""
    return np.asarray(scatter.growth[:, None] * [scatter.position_m, scatter.position_m, scatter.heading_rad])


def _student(predictor: Predictor, squares: Floats) -> tuple[Floats, Floats]:
    """Return each window's loss and weight by Student's law for three numbers, given its squared errors.

    The squares are those of a part of a window where windows tell the same again; so is the loss.
    """
    part = 1.0 / predictor.batch.redundancy
    return part * (_TAIL + 3.0) * np.log1p(squares / part / _TAIL), (_TAIL + 3.0) / (_TAIL + squares / part)


def _scatter_of_windows(readings: Readings) -> Scatter:
    """Return a scatter to start from: errors that grow with time, and hardly an offset."""
    ahead_s = np.nanmean(readings.t_s - readings.begins_s[:, None], axis=0)
    return Scatter(0.1, 0.1, _LEAST_SCATTER.copy(), ahead_s / ahead_s[-1])


def _weights(predictor: Predictor, scatter: Scatter) -> Floats:
    """Return what residuals are multiplied by (R, K, 3)."""
    temper, _ = _temper(predictor)
    return np.asarray(np.sqrt(temper)[:, None, None] * predictor.readings.seen[:, :, None] / _scale(scatter))


def _inner_inverse(a: Floats, prior: Floats) -> tuple[Floats, Floats]:
    """Return the information on each run's offsets (R, 6, 6), with its inverse."""
    inner = a.transpose(0, 2, 1) @ a
    inner[:, range(6), range(6)] += prior**-2.0
    return inner, np.asarray(np.linalg.inv(inner))


def priors(predictor: Predictor, scatter: Scatter) -> Floats:
    """Return how far each run's offsets may be from none, (R, 6)."""
    start = np.hypot(predictor.readings.start_stderr, _START_EXTRA_M)
    out = np.empty((len(predictor.readings), 6))
    out[:, :2] = start[:, :2]
    out[:, 2] = np.hypot(start[:, 2], scatter.offsets[0])
    out[:, 3:] = scatter.offsets[1:]
    return out


def _terms(
    predictor: Predictor,
    residual: Floats,
    by_parameters: Floats,
    by_offsets: Floats,
    offsets: Floats,
    scatter: Scatter,
) -> _Terms:
    runs = len(residual)
    temper, count = _temper(predictor)
    weight = _weights(predictor, scatter)
    e = (residual * weight).reshape(runs, -1)
    # A run has a few of all levels: the rest of its columns are zero.
    own = predictor.touched(by_parameters.shape[-1])
    j = np.take_along_axis(by_parameters, own[:, None, None, :], axis=-1)
    j = (j * weight[..., None]).reshape(runs, e.shape[1], -1)
    a = (by_offsets * weight[..., None]).reshape(runs, e.shape[1], 6)
    prior = priors(predictor, scatter)
    at, jt = a.transpose(0, 2, 1), j.transpose(0, 2, 1)
    inner, inverse = _inner_inverse(a, prior)
    pull = (at @ e[..., None])[..., 0] - offsets / prior**2
    short = at @ j
    rows = np.arange(runs)[:, None]
    mixed = np.zeros((runs, 6, by_parameters.shape[-1]))
    mixed[rows, :, own] = short.transpose(0, 2, 1)
    information = np.zeros((runs, mixed.shape[2], mixed.shape[2]))
    information[rows[..., None], own[:, :, None], own[:, None, :]] = jt @ j - short.transpose(0, 2, 1) @ inverse @ short
    gradient = np.zeros((runs, mixed.shape[2]))
    steep = (jt @ e[..., None])[..., 0] - (short.transpose(0, 2, 1) @ (inverse @ pull[..., None]))[..., 0]
    gradient[rows, own] = steep
    squares = np.sum(e * e, axis=1) + np.sum((offsets / prior) ** 2, axis=1)
    # The offsets are a step away from their best values: what that step gains belongs to the loss.
    squares -= np.einsum("ri,rij,rj->r", pull, inverse, pull)
    logs = np.linalg.slogdet(inner)[1] + 2.0 * np.sum(np.log(prior), axis=1)
    logs += temper * count * (4.0 * np.log(scatter.position_m) + 2.0 * np.log(scatter.heading_rad))
    if predictor.readings.begins is not None:
        logs += 6.0 * temper * (predictor.readings.seen * np.log(scatter.growth)).sum(axis=1)
        squares, trust = _student(predictor, squares)
        information *= trust[:, None, None]
        gradient = np.asarray(gradient * trust[:, None])
    return _Terms(squares + logs, information, gradient, inverse, mixed, pull)


def _step(
    predictor: Predictor,
    parameters: Floats,
    offsets: Floats,
    residual: Floats,
    terms: _Terms,
    scatter: Scatter,
    bounds: Floats,
) -> tuple[Floats, Floats, Floats]:
    """Return parameters, offsets and residual after a step that does not make things worse, or as they are.

    Where a whole step and parts of it do, the step is damped (Levenberg and Marquardt): a value that the runs hardly
    depend on must not carry all others away.
    """
    matrix = terms.information.sum(axis=0) + _ridge(predictor)
    maps = predictor.maps.size
    now = _objective(predictor, residual, offsets, scatter)
    for damping in _DAMPINGS:
        damped = matrix + damping * np.diag(np.diagonal(matrix))
        move = _move(damped, terms.gradient.sum(axis=0), parameters, bounds, maps)
        move_offsets = np.einsum("rij,rj->ri", terms.inner_inverse, terms.pull - terms.mixed @ move)
        share = 1.0
        for _ in range(_HALVINGS):
            new = parameters + share * move
            new[maps:] = np.clip(new[maps:], bounds[:, 0], bounds[:, 1])
            new_offsets = offsets + share * move_offsets
            new_residual = _residual(predictor, predictor.predict(new, new_offsets))
            if _objective(predictor, new_residual, new_offsets, scatter) <= now:
                return new, new_offsets, new_residual
            share *= 0.4
    return parameters, offsets, residual


def _move(matrix: Floats, gradient: Floats, parameters: Floats, bounds: Floats, maps: int) -> Floats:
    """Return the step that `matrix` and `gradient` ask for; effects' parameters that are stuck at a bound stay."""
    free = np.ones(len(parameters), dtype=np.bool_)
    for _ in range(3):
        move = np.zeros(len(parameters))
        move[free] = np.linalg.lstsq(matrix[np.ix_(free, free)], gradient[free], rcond=1e-12)[0]
        wanted = parameters[maps:] + move[maps:]
        kept = np.clip(wanted, bounds[:, 0], bounds[:, 1])
        held = np.flatnonzero(kept != wanted)
        # What meets its bound goes there; the others are solved for again without it.
        stuck = held[parameters[maps + held] == kept[held]]
        if not len(stuck):
            break
        free[maps + stuck] = False
    return move


def _objective(predictor: Predictor, residual: Floats, offsets: Floats, scatter: Scatter) -> float:
    temper, _ = _temper(predictor)
    seen = predictor.readings.seen[:, :, None]
    e = residual * seen / _scale(scatter)
    squares = temper * np.sum(e * e, axis=(1, 2)) + np.sum((offsets / priors(predictor, scatter)) ** 2, axis=1)
    if predictor.readings.begins is not None:
        squares, _ = _student(predictor, squares)
    return float(squares.sum())


def _rescatter(
    predictor: Predictor, residual: Floats, offsets: Floats, inner_inverse: Floats, scatter: Scatter
) -> Scatter:
    seen = predictor.readings.seen
    if predictor.readings.begins is not None:
        return _rescatter_windows(predictor, residual, scatter)
    count = float(seen.sum())
    position = np.sqrt(np.sum(residual[..., :2] ** 2 * seen[..., None]) / (2.0 * count))
    heading = np.sqrt(np.sum(residual[..., 2] ** 2 * seen) / count)
    variance = offsets[:, 2:] ** 2 + np.diagonal(inner_inverse, axis1=1, axis2=2)[:, 2:]
    return Scatter(
        max(float(position), _LEAST_M),
        max(float(heading), _LEAST_RAD),
        np.maximum(np.sqrt(variance.mean(axis=0)), _LEAST_SCATTER),
    )


def _rescatter_windows(predictor: Predictor, residual: Floats, scatter: Scatter) -> Scatter:
    seen = predictor.readings.seen
    temper, _ = _temper(predictor)
    e = residual * seen[..., None] / _scale(scatter)
    _, trust = _student(predictor, temper * np.sum(e * e, axis=(1, 2)))
    weight = seen * trust[:, None]
    total = np.maximum(seen.sum(axis=0), 1.0)
    position = np.sqrt(np.sum(residual[..., :2] ** 2 * weight[..., None], axis=(0, 2)) / (2.0 * total))
    heading = np.sqrt(np.sum(residual[..., 2] ** 2 * weight, axis=0) / total)
    # One growth for both, that of position, which is what is asked for in the end.
    growth = np.maximum(position, _LEAST_M) / max(float(position[-1]), _LEAST_M)
    return Scatter(
        max(float(position[-1]), _LEAST_M),
        max(float(np.sqrt(np.mean((heading / growth) ** 2))), _LEAST_RAD),
        scatter.offsets,
        growth,
    )


def _ridge(predictor: Predictor) -> Floats:
    """Return a prior so weak that it only speaks where the data say nothing: 1 rad, 1 m/s, 100 for effects."""
    strength = np.full(predictor.maps.size + len(predictor.parameter_names), 1.0)
    strength[predictor.maps.size :] = _WEAK
    return np.diag(strength)
