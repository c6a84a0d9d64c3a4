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

STEERING_DYNAMICS = ("steering_lag", "steering_rate_limit", "steering_backlash")


def choose_initial_steering(selector: Selector) -> Selector:
    """Return the selector, or one with the axles at their first commands if that predicts clearly better.

    The comparison is between the best models with a single effect that delays the axles.
    """
    names = [name for name in STEERING_DYNAMICS if name in selector.candidates]
    base, other = selector.base(), under_other_initial_steering(selector)
    if set(STEERING_DYNAMICS) & {cause_of(name) for name in selector.given}:
        return other if other.base().deviance < base.deviance - SELECTION.min_gain else selector
    adopted = other.adopt(base)
    if max(_predicted_gain(other, adopted, name) for name in names) < SELECTION.min_gain_of_initial_steering:
        return selector
    at_neutral = min(selector.with_effect(base, name).deviance for name in names)
    at_first = min(other.with_effect(adopted, name).deviance for name in names)
    return other if at_first < at_neutral - SELECTION.min_gain else selector


def reconsider_initial_steering(selection: Selection, selector: AnySelector) -> tuple[Selection, AnySelector]:
    """Repeat the selection under the other hypothesis if the selected model predicts clearly better under it."""
    chosen = selection.chosen
    if not set(STEERING_DYNAMICS) & {cause_of(name) for name in chosen.names}:
        return selection, selector
    other = under_other_initial_steering(selector)
    if other.score(chosen.names, chosen.fit.parameters, None).deviance >= chosen.deviance - SELECTION.min_gain:
        return selection, selector
    return other.select(), other


def under_other_initial_steering(selector: AnySelector) -> AnySelector:
    """Return a selector of the same runs under the other hypothesis."""
    return selector.for_batch(selector.batch.repacked(preset=not selector.batch.readings.preset))


def _predicted_gain(selector: Selector, base: ScoredModel, name: str) -> float:
    predictor, candidate = Predictor(selector.batch, (*base.names, name)), default_candidate(name)
    return max(first_order_gain(base.fit, predictor, start, candidate.bounds) for start in candidate.starts)
