"""One step of a fit: Gauss–Newton's, shortened or damped where a whole one makes things worse."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agvbench.diagnosis.likelihood import Terms, objective, residual_of, ridge
from agvbench.diagnosis.linearised import Linearised
from agvbench.diagnosis.prediction import Predictor
from agvbench.diagnosis.scatter import Scatter
from agvbench.types import Floats

_SHARES = (1.0, 0.4, 0.16, 0.064)
_DAMPINGS = (0.0, 0.1, 3.0)


@dataclass(frozen=True)
class Point:
    """Where a fit stands: ``parameters`` (P,), each run's ``offsets`` (R, 6) and ``residual`` (R, K, 3)."""

    parameters: Floats
    offsets: Floats
    residual: Floats


@dataclass(frozen=True)
class Stepper:
    """What stays the same during a step: derivatives, scatter, and the ``bounds`` of the effects' parameters."""

    predictor: Predictor
    linear: Linearised
    scatter: Scatter
    bounds: Floats

    def step(self, point: Point, terms: Terms) -> tuple[Point, bool]:
        """Return a point that is no worse, or the same; and whether a whole step led there.

        Where no part of a step does, it is damped (Levenberg and Marquardt): a value that the runs hardly depend on
        must not carry all others away.
        """
        now, (matrix, gradient) = self._objective(point), self._normal_equations(terms)
        for damping in _DAMPINGS:
            damped = matrix + damping * np.diag(np.diagonal(matrix))
            move, move_offsets = self._move(point, terms, damped, gradient)
            for share in _SHARES:
                tried = self._at(point, share * move, share * move_offsets)
                if self._objective(tried) <= now:
                    return tried, not damping and share == 1.0
        return point, False

    def whole(self, point: Point, terms: Terms) -> Point:
        """Return the point after a whole step, be it worse."""
        return self._at(point, *self._move(point, terms, *self._normal_equations(terms)))

    def _at(self, point: Point, move: Floats, move_offsets: Floats) -> Point:
        maps = self.predictor.maps.size
        parameters, offsets = point.parameters + move, point.offsets + move_offsets
        parameters[maps:] = np.clip(parameters[maps:], self.bounds[:, 0], self.bounds[:, 1])
        return Point(parameters, offsets, residual_of(self.predictor, self.predictor.predict(parameters, offsets)))

    def _objective(self, point: Point) -> float:
        return objective(self.predictor, point.residual, point.offsets, self.scatter)

    def _normal_equations(self, terms: Terms) -> tuple[Floats, Floats]:
        return terms.information.total + ridge(self.predictor), terms.gradient.sum(axis=0)

    def _move(self, point: Point, terms: Terms, matrix: Floats, gradient: Floats) -> tuple[Floats, Floats]:
        move = self._bounded(matrix, gradient, point.parameters)
        return move, np.einsum("rij,rj->ri", terms.inner_inverse, terms.pull - terms.mixed @ move)

    def _bounded(self, matrix: Floats, gradient: Floats, parameters: Floats) -> Floats:
        """Return the step that `matrix` and `gradient` ask for; effects' parameters that are stuck at a bound stay."""
        maps = self.predictor.maps.size
        free = np.ones(len(parameters), dtype=np.bool_)
        for _ in range(3):
            move = np.zeros(len(parameters))
            move[free] = np.linalg.lstsq(matrix[np.ix_(free, free)], gradient[free], rcond=1e-12)[0]
            wanted = parameters[maps:] + move[maps:]
            kept = np.clip(wanted, self.bounds[:, 0], self.bounds[:, 1])
            held = np.flatnonzero(kept != wanted)
            # What meets its bound goes there; the others are solved for again without it.
            stuck = held[parameters[maps + held] == kept[held]]
            if not len(stuck):
                break
            free[maps + stuck] = False
        return move
