"""Levenberg–Marquardt: damped Gauss–Newton steps, in turn with updates of the variance components."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum, auto

import numpy as np

from agvbench.diagnosis.criteria import FIT
from agvbench.diagnosis.estimation.bounded_step import bounded_step
from agvbench.diagnosis.estimation.likelihood import Terms, objective, random_effects_step, residual_of, ridge, terms_of
from agvbench.diagnosis.estimation.variance import VarianceComponents, update_variance_components
from agvbench.diagnosis.model.predictor import Linearised, Predictor
from agvbench.diagnosis.model.smoothness import PriorTerms
from agvbench.types import Floats

_STEP_LENGTHS = (1.0, 0.4, 0.16, 0.064)
_DAMPINGS = (0.0, 0.1, 3.0)
# Updates of the variance components, and the relative change below which they have converged.
_UPDATES, _MIN_CHANGE = 40, 1e-3


@dataclass(frozen=True)
class Point:
    """An iterate: ``parameters`` (P,), each run's ``random_effects`` (R, q) and ``residual`` (R, K, 3)."""

    parameters: Floats
    random_effects: Floats
    residual: Floats


@dataclass(frozen=True)
class Step:
    """The ``point`` that a step led to, whether it was ``full`` and undamped, and the reduction that was predicted.

    This ``decrement`` (Newton decrement, squared: Boyd and Vandenberghe, Convex Optimization, 2004, section 9.5) is
    that of a full step by the quadratic approximation of the objective, with the largest damping that was tried.
    """

    point: Point
    full: bool
    decrement: float


@dataclass(frozen=True)
class StepSolver:
    """Solves for one step at fixed derivatives, variance components and ``bounds`` (effects' parameters, 2)."""

    predictor: Predictor
    linear: Linearised
    variance_components: VarianceComponents
    bounds: Floats

    def step(self, point: Point, terms: Terms) -> Step:
        """Return a step to a point whose objective is no larger.

        If no fraction of the Gauss–Newton step qualifies, the step is damped (Levenberg and Marquardt). Damping keeps
        poorly determined parameters from making the whole step fail. If no damped step qualifies, the point is returned
        unchanged.
        """
        now, (matrix, gradient) = self._objective(point), self._normal_equations(point, terms)
        for damping in _DAMPINGS:
            damped = matrix + damping * np.diag(np.diagonal(matrix))
            move, move_random_effects = self._move(point, terms, damped, gradient)
            decrement = float(2.0 * gradient @ move - move @ damped @ move)
            for length in _STEP_LENGTHS:
                tried = self._at(point, length * move, length * move_random_effects)
                if self._objective(tried) <= now:
                    return Step(tried, not damping and length == 1.0, decrement)
        return Step(point, False, decrement)

    def full(self, point: Point, terms: Terms) -> Point:
        """Return the point after a full step, even if its objective is larger."""
        return self._at(point, *self._move(point, terms, *self._normal_equations(point, terms)))

    def _at(self, point: Point, move: Floats, move_random_effects: Floats) -> Point:
        maps = self.predictor.maps.size
        parameters, random_effects = point.parameters + move, point.random_effects + move_random_effects
        parameters[maps:] = np.clip(parameters[maps:], self.bounds[:, 0], self.bounds[:, 1])
        return Point(
            parameters, random_effects, residual_of(self.predictor, self.predictor.predict(parameters, random_effects))
        )

    def _objective(self, point: Point) -> float:
        prior = self.predictor.prior_loss(point.parameters)
        return prior + objective(self.predictor, point.residual, point.random_effects, self.variance_components)

    def _normal_equations(self, point: Point, terms: Terms) -> tuple[Floats, Floats]:
        prior = self.predictor.prior(point.parameters)
        matrix = terms.information.total + ridge(self.predictor) + prior.information
        return matrix, terms.gradient.sum(axis=0) + prior.gradient

    def _move(self, point: Point, terms: Terms, matrix: Floats, gradient: Floats) -> tuple[Floats, Floats]:
        move = bounded_step(matrix, gradient, point.parameters, self.bounds)
        return move, np.einsum("rij,rj->ri", terms.inner_inverse, terms.pull - terms.mixed @ move)


@dataclass(frozen=True)
class FitState:
    """The estimates of a fit: ``parameters`` (P,), each run's ``random_effects`` (R, q), ``variance_components``."""

    parameters: Floats
    random_effects: Floats
    variance_components: VarianceComponents


@dataclass(frozen=True)
class Evaluation:
    """The model evaluated at a state.

    Derivatives, ``residual`` (R, K, 3), the terms of the likelihood, and those of the ``prior`` of maps and effects.
    """

    linear: Linearised
    residual: Floats
    terms: Terms
    prior: PriorTerms

    @property
    def loss(self) -> float:
        """Minus two log posterior: of all runs and of the priors."""
        return float(self.terms.loss.sum()) + self.prior.loss


class Convergence(Enum):
    """State of the iteration after its steps: converged, or ending with shortened (slow) or full (fast) steps."""

    CONVERGED = auto()
    SLOW = auto()
    FAST = auto()


@dataclass(frozen=True)
class Iterated:
    """The result of an iteration: the last ``state``, its ``convergence``, and the derivatives of the last step."""

    state: FitState
    convergence: Convergence
    linear: Linearised | None


@dataclass(frozen=True)
class LevenbergMarquardt:
    """Minimises the loss of one model; ``bounds`` (effects' parameters, 2)."""

    predictor: Predictor
    bounds: Floats

    def evaluate(self, state: FitState, near: Linearised | None = None) -> Evaluation:
        """Evaluate the model at `state`; `near` supplies the derivatives that it has if given.

        Raises
        ------
        numpy.linalg.LinAlgError
            If a prediction or one of its derivatives is not finite: parameters far from the truth divide by zero.
        """
        linear = self.predictor.linearise(state.parameters, state.random_effects, near)
        residual = residual_of(self.predictor, linear.poses)
        with np.errstate(over="ignore", invalid="ignore"):
            terms = terms_of(self.predictor, residual, linear, state.random_effects, state.variance_components)
        if not (np.isfinite(terms.gradient).all() and np.isfinite(terms.information.blocks).all()):
            raise np.linalg.LinAlgError("the model cannot be evaluated")
        return Evaluation(linear, residual, terms, self.predictor.prior(state.parameters))

    def iterate(self, state: FitState, iterations: int, near: Linearised | None = None) -> Iterated:
        """Return the state after at most `iterations` steps.

        The first steps use the derivatives from `near` if given. Once a step can reduce the objective by little, the
        model is nearly linear over the remaining steps, and these use the derivatives of that step (chord method). The
        last step has derivatives of its own: where residuals are large, others lead to another point. If it reduces
        the loss by little although more was predicted, further ones will not either. A step to where the model cannot
        be evaluated is undone, and ends the iteration.
        """
        before, own, had_own = np.inf, None, False
        known: FitState | None = None
        for step in range(iterations):
            try:
                evaluation = self.evaluate(state, own if near is None else near)
                known, reduction = state, before - evaluation.loss
                if had_own and abs(reduction) < FIT.converged:
                    break
                state, taken = self._step(state, evaluation)
            except np.linalg.LinAlgError:
                if known is None:
                    raise
                return Iterated(known, Convergence.CONVERGED, None)
            had_own = near is None and own is None
            before = evaluation.loss
            if near is not None:
                if reduction < FIT.nearly_converged or step >= iterations // 2:
                    # That a step by other derivatives gained nothing is no sign of convergence.
                    near, before = None, np.inf
            elif taken.decrement < FIT.converged or abs(reduction) < FIT.converged:
                if own is None:
                    return Iterated(state, Convergence.CONVERGED, evaluation.linear)
                own, before = None, np.inf
            else:
                own = evaluation.linear if taken.decrement < FIT.nearly_converged else None
        return Iterated(state, Convergence.FAST if taken.full else Convergence.SLOW, evaluation.linear)

    def at_fixed_point(self, state: FitState, evaluation: Evaluation) -> tuple[FitState, Evaluation]:
        """Return the state with variance components and random effects at the fixed point of their updates.

        Their updates converge slowly and do not minimise the loss, so that fits with different numbers of updates could
        not be compared. Neither changes the parameters. The prediction is linear in random effects of their size, and
        is not simulated for each update.
        """
        linear, residual, seen = evaluation.linear, evaluation.residual, self.predictor.readings.seen[..., None]
        for _ in range(_UPDATES):
            move, inverse = random_effects_step(
                self.predictor, residual, linear, state.random_effects, state.variance_components
            )
            residual = residual - np.einsum("rkcm,rm->rkc", linear.by_random_effects, move) * seen
            point = Point(state.parameters, state.random_effects + move, residual)
            before, state = state.variance_components, self._updated(point, state, inverse, linear)
            if before.change_to(state.variance_components) < _MIN_CHANGE:
                break
        return state, self.evaluate(state, linear)

    def converge(self, iterated: Iterated, iterations: int, *, patient: bool) -> tuple[FitState, Evaluation]:
        """Iterate further, and return the final state with its evaluation.

        A fit that converges slowly tries non-monotone steps. A `patient` fit continues even if they fail, and adds
        rounds of `iterations` steps as long as each round reduces the loss enough.
        """
        evaluation = self._evaluate_last(iterated)
        for _ in range(FIT.rounds if patient else 1):
            state, convergence = iterated.state, iterated.convergence
            beyond = self.non_monotone_steps(state, evaluation) if convergence is Convergence.SLOW else None
            if convergence is Convergence.CONVERGED or (beyond is None and not patient):
                break
            iterated = self.iterate(state if beyond is None else beyond, iterations)
            before, evaluation = evaluation.loss, self._evaluate_last(iterated)
            if before - evaluation.loss < FIT.min_reduction:
                break
        return self.at_fixed_point(iterated.state, evaluation)

    def _evaluate_last(self, iterated: Iterated) -> Evaluation:
        """Evaluate the model at the end of an iteration; if it converged, with the derivatives of its last step."""
        return self.evaluate(iterated.state, iterated.linear if iterated.convergence is Convergence.CONVERGED else None)

    def leave_plateaus(
        self, state: FitState, evaluation: Evaluation, iterations: int, *, patient: bool
    ) -> tuple[FitState, Evaluation]:
        """Return a state with a smaller loss outside a plateau of the likelihood, or the given one if there is none.

        Backlash makes the likelihood flat: a command inside the gap has zero gradient, so the iteration cannot leave
        it, although the axle did move. Such nodal values are unobserved. They are interpolated between their
        neighbours, and the iteration starts again from there.
        """
        maps = self.predictor.maps
        information, prior = evaluation.terms.information.total, ridge(self.predictor)
        unobserved = np.diagonal(information)[: maps.size] < np.diagonal(prior)[: maps.size]
        if not unobserved.any():
            return state, evaluation
        parameters = np.r_[maps.interpolated(state.parameters[: maps.size], unobserved), state.parameters[maps.size :]]
        first = self.iterate(replace(state, parameters=parameters), iterations)
        final, evaluated = self.converge(first, iterations, patient=patient)
        return (final, evaluated) if evaluated.loss < evaluation.loss else (state, evaluation)

    def non_monotone_steps(self, state: FitState, evaluation: Evaluation) -> FitState | None:
        """Return a state with a smaller loss, reached by full steps, or None; `evaluation` is that of `state`.

        Maps that have absorbed an effect release it along a curved, narrow valley of the loss: every full step leaves
        the valley, and short steps make little progress. A limited number of full steps is therefore accepted although
        the loss increases at first (watchdog technique: Chamberlain et al., Mathematical Programming Study 16, 1982).
        The variance components grow with the residual, which widens the valley.
        """
        start, near = evaluation.loss, evaluation.linear.by_first(self.predictor.maps.size)
        try:
            point = self._step_solver(state, evaluation).full(self._point(state, evaluation), evaluation.terms)
            now = self._updated(point, state, evaluation.terms.inner_inverse, evaluation.linear)
            for _ in range(FIT.non_monotone_steps):
                evaluation = self.evaluate(now, near)
                if evaluation.loss < start - FIT.min_reduction:
                    return now
                now, _ = self._step(now, evaluation)
        except np.linalg.LinAlgError:
            return None
        return now if evaluation.loss < start - FIT.nearly_converged else None

    def _step(self, state: FitState, evaluation: Evaluation) -> tuple[FitState, Step]:
        """Return the state after a step that does not increase the objective, and the step."""
        taken = self._step_solver(state, evaluation).step(self._point(state, evaluation), evaluation.terms)
        return self._updated(taken.point, state, evaluation.terms.inner_inverse, evaluation.linear), taken

    def _step_solver(self, state: FitState, evaluation: Evaluation) -> StepSolver:
        return StepSolver(self.predictor, evaluation.linear, state.variance_components, self.bounds)

    @staticmethod
    def _point(state: FitState, evaluation: Evaluation) -> Point:
        return Point(state.parameters, state.random_effects, evaluation.residual)

    def _updated(self, point: Point, state: FitState, inner_inverse: Floats, linear: Linearised) -> FitState:
        variance_components = update_variance_components(
            self.predictor,
            point.residual,
            point.random_effects,
            inner_inverse,
            linear.by_random_effects,
            state.variance_components,
        )
        return FitState(point.parameters, point.random_effects, variance_components)
