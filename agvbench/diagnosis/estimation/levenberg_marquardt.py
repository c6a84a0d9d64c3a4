"""How a fit converges: damped Gauss–Newton steps, in turn with the variance components."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum, auto

import numpy as np

from agvbench.diagnosis.estimation.likelihood import Terms, objective, residual_of, ridge, terms_of
from agvbench.diagnosis.estimation.variance import Scatter, rescatter
from agvbench.diagnosis.model.predictor import Linearised, Predictor
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


_EXCURSION, _ROUNDS = 6, 4
_WORTH = 10.0
_ENOUGH = 0.05
_CLOSE = 1.0


@dataclass(frozen=True)
class State:
    """What a fit has found so far: ``parameters`` (P,), ``offsets`` (R, 6) of each run, and their scatter."""

    parameters: Floats
    offsets: Floats
    scatter: Scatter


@dataclass(frozen=True)
class View:
    """What is seen from a state: derivatives, ``residual`` (R, K, 3), and the likelihood about it."""

    linear: Linearised
    residual: Floats
    terms: Terms

    @property
    def loss(self) -> float:
        """Minus two log likelihood of all runs."""
        return float(self.terms.loss.sum())


class Pace(Enum):
    """How a way goes when its steps are used up: it has come to a stand, or goes on by parts of steps or whole ones."""

    STANDS = auto()
    CREEPS = auto()
    STRIDES = auto()


@dataclass(frozen=True)
class Descent:
    """Goes down for one model; ``bounds`` (effects' parameters, 2)."""

    predictor: Predictor
    bounds: Floats

    def look(self, state: State, near: Linearised | None = None) -> View:
        """Return what is seen from `state`, with the maps' derivatives from `near` where given."""
        linear = self.predictor.linearise(state.parameters, state.offsets, near)
        residual = residual_of(self.predictor, linear.poses)
        terms = terms_of(self.predictor, residual, linear, state.offsets, state.scatter)
        return View(linear, residual, terms)

    def go(self, state: State, iterations: int, near: Linearised | None = None) -> tuple[State, Pace]:
        """Return the state after at most so many steps, and how it went at the end.

        With `near` the first steps are taken with the maps' derivatives from there.
        """
        before, whole = np.inf, True
        for step in range(iterations):
            view = self.look(state, near)
            state, whole = self._follow(state, view)
            if near is not None and (before - view.loss < _CLOSE or step >= iterations // 2):
                near = None
            elif abs(before - view.loss) < _ENOUGH:
                return state, Pace.STANDS
            before = view.loss
        return state, Pace.STRIDES if whole else Pace.CREEPS

    def arrive(self, state: State, pace: Pace, iterations: int, *, patient: bool) -> tuple[State, View]:
        """Return the end of the way, and what is seen from there.

        A creeping fit tries an excursion. One that is `patient` goes on also where that leads nowhere, and round after
        round as long as they are worth their steps.
        """
        view = self.look(state)
        for _ in range(_ROUNDS if patient else 1):
            beyond = self.excursion(state, view) if pace is Pace.CREEPS else None
            if pace is Pace.STANDS or (beyond is None and not patient):
                break
            state, pace = self.go(state if beyond is None else beyond, iterations)
            before, view = view.loss, self.look(state)
            if before - view.loss < _WORTH:
                break
        return state, view

    def off_plateaus(self, state: State, view: View, iterations: int, *, patient: bool) -> tuple[State, View]:
        """Return a better end of the way where values of the maps have come to lie where no run tells them; else this.

        Play has plateaus: a command that ends within it moves nothing, and has no slope that led out again, be it that
        the axle did move. So such values are laid between their neighbours, and the way goes on from there.
        """
        maps = self.predictor.maps
        told, doubt = view.terms.information.total, ridge(self.predictor)
        silent = np.diagonal(told)[: maps.size] < np.diagonal(doubt)[: maps.size]
        if not silent.any():
            return state, view
        parameters = np.r_[maps.bridged(state.parameters[: maps.size], silent), state.parameters[maps.size :]]
        begun, pace = self.go(replace(state, parameters=parameters), iterations)
        end, seen = self.arrive(begun, pace, iterations, patient=patient)
        return (end, seen) if seen.loss < view.loss else (state, view)

    def excursion(self, state: State, view: View) -> State | None:
        """Return a better state that lies across a bend, or None; `view` is what is seen from `state`.

        Maps that took up a cause give it back along a curved and narrow valley: every whole step leaves it, and short
        ones creep. So whole steps are taken for a while, however much worse they are at first; the scatter grows with
        the residual, which widens the valley (the watchdog technique of Chamberlain and others, Mathematical
        Programming Study 16, 1982).
        """
        start, near = view.loss, view.linear
        point = self._stepper(state, view).whole(self._point(state, view), view.terms)
        now = self._reach(point, state, view)
        for _ in range(_EXCURSION):
            view = self.look(now, near)
            if view.loss < start - _WORTH:
                return now
            now, _ = self._follow(now, view)
        return None

    def _follow(self, state: State, view: View) -> tuple[State, bool]:
        """Return a state that is no worse for the scatter at hand, and whether a whole step led there."""
        point, whole = self._stepper(state, view).step(self._point(state, view), view.terms)
        return self._reach(point, state, view), whole

    def _stepper(self, state: State, view: View) -> Stepper:
        return Stepper(self.predictor, view.linear, state.scatter, self.bounds)

    @staticmethod
    def _point(state: State, view: View) -> Point:
        return Point(state.parameters, state.offsets, view.residual)

    def _reach(self, point: Point, state: State, view: View) -> State:
        scatter = rescatter(self.predictor, point.residual, point.offsets, view.terms.inner_inverse, state.scatter)
        return State(point.parameters, point.offsets, scatter)
