"""The way a fit goes down: a step for parameters and offsets, then one for the scatter, and excursions across bends."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum, auto

import numpy as np

from agvbench.diagnosis.likelihood import Terms, residual_of, ridge, terms_of
from agvbench.diagnosis.linearised import Linearised
from agvbench.diagnosis.prediction import Predictor
from agvbench.diagnosis.scatter import Scatter, rescatter
from agvbench.diagnosis.stepping import Point, Stepper
from agvbench.types import Floats

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
