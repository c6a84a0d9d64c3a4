"""Free maps and effects fitted together, with what differs from run to run integrated out.

Each run has its own start pose, an offset of each axle and a factor on its speed, drawn about zero with a scatter that
is estimated, too. Without them a run's frames would pass for as many pieces of evidence, and the smallest play in a
servo for an effect.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from agvbench.diagnosis.likelihood import Terms, objective, residual_of, ridge, terms_of
from agvbench.diagnosis.prediction import Linearised, Predictor
from agvbench.diagnosis.promises import Ground
from agvbench.diagnosis.scatter import Scatter, first_scatter, rescatter, scatter_of_windows
from agvbench.types import Floats

_ITERATIONS = 8
_HALVINGS = 4
_DAMPINGS = (0.0, 0.1, 3.0)
_ENOUGH = 0.05
_CLOSE = 1.0


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
        return np.asarray(np.linalg.pinv(self.information.sum(axis=0) + ridge(self.predictor), hermitian=True))

    @cached_property
    def ground(self) -> Ground:
        """What every promise of a larger model starts from."""
        return Ground.of(self)

    def effect_values(self) -> dict[str, float]:
        """Return the effects' parameters by name."""
        own = self.parameters[self.predictor.maps.size :]
        return dict(zip(self.predictor.parameter_names, own.tolist(), strict=True))


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
    scatter = scatter or (first_scatter() if predictor.readings.begins is None else scatter_of_windows(readings))
    parameters = parameters.copy()
    before = np.inf
    for step in range(iterations):
        linear = predictor.linearise(parameters, offsets, near)
        residual = residual_of(predictor, linear.poses)
        terms = terms_of(predictor, residual, linear.by_parameters, linear.by_offsets, offsets, scatter)
        parameters, offsets, residual = _step(predictor, parameters, offsets, residual, terms, scatter, bounds)
        scatter = rescatter(predictor, residual, offsets, terms.inner_inverse, scatter)
        after = float(terms.loss.sum())
        if near is not None and (before - after < _CLOSE or step >= iterations // 2):
            near = None
        elif abs(before - after) < _ENOUGH:
            break
        before = after
    linear = predictor.linearise(parameters, offsets)
    residual = residual_of(predictor, linear.poses)
    terms = terms_of(predictor, residual, linear.by_parameters, linear.by_offsets, offsets, scatter)
    return Fit(predictor, parameters, offsets, scatter, terms.loss, terms.information, terms.gradient, residual, linear)


def loss_at(fitted: Fit, parameters: Floats) -> Floats:
    """Return each run's loss (R,) at other parameters, by simulation, with the scatter of `fitted`."""
    predictor = fitted.predictor
    residual = residual_of(predictor, predictor.predict(parameters, fitted.offsets))
    none = fitted.linear.by_parameters[..., :0]
    return terms_of(predictor, residual, none, fitted.linear.by_offsets, fitted.offsets, fitted.scatter).loss


def _step(
    predictor: Predictor,
    parameters: Floats,
    offsets: Floats,
    residual: Floats,
    terms: Terms,
    scatter: Scatter,
    bounds: Floats,
) -> tuple[Floats, Floats, Floats]:
    """Return parameters, offsets and residual after a step that does not make things worse, or as they are.

    Where a whole step and parts of it do, the step is damped (Levenberg and Marquardt): a value that the runs hardly
    depend on must not carry all others away.
    """
    matrix = terms.information.sum(axis=0) + ridge(predictor)
    maps = predictor.maps.size
    now = objective(predictor, residual, offsets, scatter)
    for damping in _DAMPINGS:
        damped = matrix + damping * np.diag(np.diagonal(matrix))
        move = _move(damped, terms.gradient.sum(axis=0), parameters, bounds, maps)
        move_offsets = np.einsum("rij,rj->ri", terms.inner_inverse, terms.pull - terms.mixed @ move)
        share = 1.0
        for _ in range(_HALVINGS):
            new = parameters + share * move
            new[maps:] = np.clip(new[maps:], bounds[:, 0], bounds[:, 1])
            new_offsets = offsets + share * move_offsets
            new_residual = residual_of(predictor, predictor.predict(new, new_offsets))
            if objective(predictor, new_residual, new_offsets, scatter) <= now:
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
