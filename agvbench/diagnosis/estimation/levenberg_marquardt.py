"""How a fit converges: damped Gauss–Newton steps, in turn with the variance components."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum, auto

import numpy as np

from agvbench.diagnosis.estimation.likelihood import Terms, objective, residual_of, ridge, terms_of
from agvbench.diagnosis.estimation.variance import VarianceComponents, update_variance_components
from agvbench.diagnosis.model.predictor import Linearised, Predictor
from agvbench.types import Floats

_SHARES = (1.0, 0.4, 0.16, 0.064)
_DAMPINGS = (0.0, 0.1, 3.0)


@dataclass(frozen=True)
class Point:
    """Where a fit stands: ``parameters`` (P,), each run's ``random_effects`` (R, 6) and ``residual`` (R, K, 3)."""

    parameters: Floats
    random_effects: Floats
    residual: Floats


@dataclass(frozen=True)
class StepSolver:
    """Constants of a step: derivatives, variance components, and the ``bounds`` of the effects' parameters."""

    predictor: Predictor
    linear: Linearised
    variance_components: VarianceComponents
    bounds: Floats

    def step(self, point: Point, terms: Terms) -> tuple[Point, bool]:
        """Return a point that is no worse, or the same; and whether a whole step led there.

        Where no part of a step does, it is damped (Levenberg and Marquardt): a value that the runs hardly depend on
        must not carry all others away.
        """
        now, (matrix, gradient) = self._objective(point), self._normal_equations(terms)
        for damping in _DAMPINGS:
            damped = matrix + damping * np.diag(np.diagonal(matrix))
            move, move_random_effects = self._move(point, terms, damped, gradient)
            for share in _SHARES:
                tried = self._at(point, share * move, share * move_random_effects)
                if self._objective(tried) <= now:
                    return tried, not damping and share == 1.0
        return point, False

    def whole(self, point: Point, terms: Terms) -> Point:
        """Return the point after a whole step, be it worse."""
        return self._at(point, *self._move(point, terms, *self._normal_equations(terms)))

    def _at(self, point: Point, move: Floats, move_random_effects: Floats) -> Point:
        maps = self.predictor.maps.size
        parameters, random_effects = point.parameters + move, point.random_effects + move_random_effects
        parameters[maps:] = np.clip(parameters[maps:], self.bounds[:, 0], self.bounds[:, 1])
        return Point(
            parameters, random_effects, residual_of(self.predictor, self.predictor.predict(parameters, random_effects))
        )

    def _objective(self, point: Point) -> float:
        return objective(self.predictor, point.residual, point.random_effects, self.variance_components)

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


_NON_MONOTONE_STEPS, _ROUNDS = 6, 4
_WORTH = 10.0
_ENOUGH = 0.05
_CLOSE = 1.0


@dataclass(frozen=True)
class FitState:
    """What a fit has found so far: ``parameters`` (P,), ``random_effects`` (R, 6) of each run, and their variance."""

    parameters: Floats
    random_effects: Floats
    variance_components: VarianceComponents


@dataclass(frozen=True)
class Evaluation:
    """What is seen from a state: derivatives, ``residual`` (R, K, 3), and the likelihood about it."""

    linear: Linearised
    residual: Floats
    terms: Terms

    @property
    def loss(self) -> float:
        """Minus two log likelihood of all runs."""
        return float(self.terms.loss.sum())


class Convergence(Enum):
    """How a way goes when its steps are used up: it has come to a stand, or goes on by parts of steps or whole ones."""

    CONVERGED = auto()
    SLOW = auto()
    FAST = auto()


@dataclass(frozen=True)
class LevenbergMarquardt:
    """Goes down for one model; ``bounds`` (effects' parameters, 2)."""

    predictor: Predictor
    bounds: Floats

    def evaluate(self, state: FitState, near: Linearised | None = None) -> Evaluation:
        """Return what is seen from `state`, with the maps' derivatives from `near` where given."""
        linear = self.predictor.linearise(state.parameters, state.random_effects, near)
        residual = residual_of(self.predictor, linear.poses)
        terms = terms_of(self.predictor, residual, linear, state.random_effects, state.variance_components)
        return Evaluation(linear, residual, terms)

    def go(self, state: FitState, iterations: int, near: Linearised | None = None) -> tuple[FitState, Convergence]:
        """Return the state after at most so many steps, and how it went at the end.

        With `near` the first steps are taken with the maps' derivatives from there.
        """
        before, whole = np.inf, True
        for step in range(iterations):
            evaluation = self.evaluate(state, near)
            state, whole = self._follow(state, evaluation)
            if near is not None and (before - evaluation.loss < _CLOSE or step >= iterations // 2):
                near = None
            elif abs(before - evaluation.loss) < _ENOUGH:
                return state, Convergence.CONVERGED
            before = evaluation.loss
        return state, Convergence.FAST if whole else Convergence.SLOW

    def converge(
        self, state: FitState, convergence: Convergence, iterations: int, *, patient: bool
    ) -> tuple[FitState, Evaluation]:
        """Return the end of the way, and what is seen from there.

        A fit that converges slowly tries non-monotone steps. One that is `patient` goes on also where that leads
        nowhere, and round after
        round as long as they are worth their steps.
        """
        evaluation = self.evaluate(state)
        for _ in range(_ROUNDS if patient else 1):
            beyond = self.non_monotone_steps(state, evaluation) if convergence is Convergence.SLOW else None
            if convergence is Convergence.CONVERGED or (beyond is None and not patient):
                break
            state, convergence = self.go(state if beyond is None else beyond, iterations)
            before, evaluation = evaluation.loss, self.evaluate(state)
            if before - evaluation.loss < _WORTH:
                break
        return state, evaluation

    def leave_plateaus(
        self, state: FitState, evaluation: Evaluation, iterations: int, *, patient: bool
    ) -> tuple[FitState, Evaluation]:
        """Return a better optimum where values of the maps came to lie where no run observes them; else this one.

        Backlash makes the likelihood flat: a command inside the gap has zero gradient, so the optimiser cannot leave
        it, even where the axle did move. So such values are interpolated, and the fit goes on from there.
        """
        maps = self.predictor.maps
        information, prior = evaluation.terms.information.total, ridge(self.predictor)
        unobserved = np.diagonal(information)[: maps.size] < np.diagonal(prior)[: maps.size]
        if not unobserved.any():
            return state, evaluation
        parameters = np.r_[maps.interpolated(state.parameters[: maps.size], unobserved), state.parameters[maps.size :]]
        begun, convergence = self.go(replace(state, parameters=parameters), iterations)
        end, seen = self.converge(begun, convergence, iterations, patient=patient)
        return (end, seen) if seen.loss < evaluation.loss else (state, evaluation)

    def non_monotone_steps(self, state: FitState, evaluation: Evaluation) -> FitState | None:
        """Return a better state that lies across a bend, or None; `evaluation` is what is seen from `state`.

        Maps that absorbed a cause give it back along a curved and narrow valley: every whole step leaves it, and short
        ones converge slowly. So whole steps are taken for a while, however much worse they are at first; the variance
        grows with the residual, which widens the valley (the watchdog technique of Chamberlain and others,
        Mathematical Programming Study 16, 1982).
        """
        start, near = evaluation.loss, evaluation.linear
        point = self._step_solver(state, evaluation).whole(self._point(state, evaluation), evaluation.terms)
        now = self._reach(point, state, evaluation)
        for _ in range(_NON_MONOTONE_STEPS):
            evaluation = self.evaluate(now, near)
            if evaluation.loss < start - _WORTH:
                return now
            now, _ = self._follow(now, evaluation)
        return None

    def _follow(self, state: FitState, evaluation: Evaluation) -> tuple[FitState, bool]:
        """Return a state that is no worse for the variance components at hand, and whether a whole step led there."""
        point, whole = self._step_solver(state, evaluation).step(self._point(state, evaluation), evaluation.terms)
        return self._reach(point, state, evaluation), whole

    def _step_solver(self, state: FitState, evaluation: Evaluation) -> StepSolver:
        return StepSolver(self.predictor, evaluation.linear, state.variance_components, self.bounds)

    @staticmethod
    def _point(state: FitState, evaluation: Evaluation) -> Point:
        return Point(state.parameters, state.random_effects, evaluation.residual)

    def _reach(self, point: Point, state: FitState, evaluation: Evaluation) -> FitState:
        variance_components = update_variance_components(
            self.predictor,
            point.residual,
            point.random_effects,
            evaluation.terms.inner_inverse,
            state.variance_components,
        )
        return FitState(point.parameters, point.random_effects, variance_components)
