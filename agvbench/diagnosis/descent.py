"""The way a fit goes down: a step for parameters and offsets, then one for the scatter, and excursions across bends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agvbench.diagnosis.likelihood import Terms, residual_of, terms_of
from agvbench.diagnosis.prediction import Linearised, Predictor
from agvbench.diagnosis.scatter import Scatter, rescatter
from agvbench.diagnosis.stepping import Point, Stepper
from agvbench.types import Floats

_EXCURSION = 6
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


@dataclass(frozen=True)
class Descent:
    """Goes down for one model; ``bounds`` (effects' parameters, 2)."""

    predictor: Predictor
    bounds: Floats

    def look(self, state: State, near: Linearised | None = None) -> View:
        """Return what is seen from `state`, with the maps' derivatives from `near` where given."""
        linear = self.predictor.linearise(state.parameters, state.offsets, near)
        residual = residual_of(self.predictor, linear.poses)
        terms = terms_of(
            self.predictor, residual, linear.by_parameters, linear.by_offsets, state.offsets, state.scatter
        )
        return View(linear, residual, terms)

    def go(self, state: State, iterations: int, near: Linearised | None = None) -> tuple[State, bool]:
        """Return the state after at most so many steps, and whether it still crept at the end, by parts of steps.

        With `near` the first steps are taken with the maps' derivatives from there.
        """
        before, whole, ended = np.inf, True, False
        for step in range(iterations):
            view = self.look(state, near)
            state, whole = self._follow(state, view)
            if near is not None and (before - view.loss < _CLOSE or step >= iterations // 2):
                near = None
            elif ended := abs(before - view.loss) < _ENOUGH:
                break
            before = view.loss
        return state, not (whole or ended)

    def excursion(self, state: State, view: View) -> State | None:
        """Return a better state that lies across a bend, or None; `view` is what is seen from `state`.

        Maps that took up a cause give it back along a curved and narrow valley: every whole step leaves it, and short
        ones creep. So whole steps are taken for a while, however much worse they are at first; the scatter grows with
        the residual, which widens the valley (the watchdog technique of Chamberlain and others, Mathematical
        Programming Study 16, 1982).
        """
        start, near = view.loss, view.linear
        point = self._stepper(state, view).whole(self._point(state, view), view.terms)
        now = self._arrive(point, state, view)
        for _ in range(_EXCURSION):
            view = self.look(now, near)
            if view.loss < start - _WORTH:
                return now
            now, _ = self._follow(now, view)
        return None

    def _follow(self, state: State, view: View) -> tuple[State, bool]:
        """Return a state that is no worse for the scatter at hand, and whether a whole step led there."""
        point, whole = self._stepper(state, view).step(self._point(state, view), view.terms)
        return self._arrive(point, state, view), whole

    def _stepper(self, state: State, view: View) -> Stepper:
        return Stepper(self.predictor, view.linear, state.scatter, self.bounds)

    @staticmethod
    def _point(state: State, view: View) -> Point:
        return Point(state.parameters, state.offsets, view.residual)

    def _arrive(self, point: Point, state: State, view: View) -> State:
        scatter = rescatter(self.predictor, point.residual, point.offsets, view.terms.inner_inverse, state.scatter)
        return State(point.parameters, point.offsets, scatter)
