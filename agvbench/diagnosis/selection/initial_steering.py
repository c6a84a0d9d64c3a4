"""The initial state of the steering: both axles at neutral, or at each run's first command.

Some benches leave the axles at neutral between runs, others set them long before the clock starts, and no campaign
records which. The initial state matters only to effects that delay the axles. There a wrong assumption mimics another
effect: a servo that is already at its target seems infinitely fast. The runs therefore decide between both hypotheses.

Windows of free driving begin with the yaw rate that was measured, or with the axle angles that the commands before
them result in. The measured one is noisy and late, the commanded one as wrong as the model: the windows decide, too.
"""

from __future__ import annotations

from agvbench.diagnosis.criteria import SELECTION
from agvbench.diagnosis.estimation.score_test import first_order_gain
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.candidates import default_candidate
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import AnySelector, Selection, Selector
from agvbench.effects.variants import cause_of

STEERING_DYNAMICS = ("steering_lag", "steering_rate_limit", "steering_backlash", "turning_resistance")


def choose_initial_steering(selector: AnySelector) -> AnySelector:
    """Return the selector, or one with the axles at their first commands if that predicts clearly better.

    The comparison is between the best models with a single effect that delays the axles.
    """
    if not has_initial_steering(selector):
        return selector
    base, other = selector.base(), under_other_initial_steering(selector)
    if set(STEERING_DYNAMICS) & selector.given_causes:
        return other if other.base().deviance < base.deviance - SELECTION.min_gain else selector
    return other if _is_better_beside(other, other.adopt(base), selector, base) else selector


def select_with_initial_steering(selector: AnySelector) -> tuple[Selection, AnySelector]:
    """Select effects, and change the hypothesis as soon as the model predicts clearly better under the other one.

    Beside the wrong hypothesis, effects that compensate for it would be selected in the further steps.
    """
    here, other = selector, under_other_initial_steering(selector)
    current = here.base()
    while True:  # each step and each change reduces the deviance
        larger, rejected = here.step(current)
        if larger is None:
            return _reconsidered(here.completed(current, rejected), here, other)
        current, there = larger, other.refitted_if_better(larger)
        if there is not None and there.deviance < current.deviance - SELECTION.min_gain:
            here, other, current = other, here, there


def reconsider_initial_steering(selection: Selection, selector: AnySelector) -> tuple[Selection, AnySelector]:
    """Repeat the selection under the other hypothesis if the selected model predicts clearly better under it.

    If the model has no effect that delays the axles, the best one of them is added under both hypotheses. Beside a
    cause that was missing when the hypothesis was chosen, the other one may be right.
    """
    if not has_initial_steering(selector):
        return selection, selector
    return _reconsidered(selection, selector, under_other_initial_steering(selector))


def _reconsidered(selection: Selection, selector: AnySelector, other: AnySelector) -> tuple[Selection, AnySelector]:
    """Return the selection with its selector, or that of the `other` selector; see `reconsider_initial_steering`."""
    chosen = selection.chosen
    has_delay = bool(set(STEERING_DYNAMICS) & {cause_of(name) for name in chosen.names})
    if not has_delay and chosen.names == selector.given:
        return selection, selector
    there = other.refitted(chosen)
    if there is None:
        return selection, selector
    is_better = there.deviance < chosen.deviance - SELECTION.min_gain
    if is_better if has_delay else _is_better_beside(other, there, selector, chosen):
        return other.select(), other
    return selection, selector


def _is_better_beside(other: Selector, there: ScoredModel, selector: Selector, here: ScoredModel) -> bool:
    """Return whether an effect that delays the axles predicts clearly better beside `there` than any beside `here`."""
    names = [name for name in STEERING_DYNAMICS if name in selector.candidates]
    gains = [_predicted_gain(other, there, name) for name in names]
    if max(gains, default=0.0) < SELECTION.min_gain_of_initial_steering:
        return False
    best, other_best = (
        min(one.with_effect(model, name).deviance for name in names)
        for one, model in ((selector, here), (other, there))
    )
    return other_best < min(best, here.deviance) - SELECTION.min_gain


def has_initial_steering(selector: Selector) -> bool:
    """Return whether the steering can have been set before a run: a differential vehicle at rest has no yaw rate."""
    readings = selector.batch.readings
    return not selector.batch.geometry.is_differential or readings.initial_states is not None


def under_other_initial_steering(selector: AnySelector) -> AnySelector:
    """Return a selector of the same runs under the other hypothesis."""
    return selector.for_batch(selector.batch.repacked(preset=not selector.batch.readings.preset))


def _predicted_gain(selector: Selector, base: ScoredModel, name: str) -> float:
    predictor, candidate = Predictor(selector.batch, (*base.names, name)), default_candidate(name)
    return max(first_order_gain(base.fit, predictor, start, candidate.bounds) for start in candidate.starts)
