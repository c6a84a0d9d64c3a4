"""Where the steering stood before a run's first command: at neutral, or at that command already.

Some benches leave the axles at neutral between runs, others set them long before the clock starts, and no
campaign says which. It matters only to what moves the axles with a delay, and there a wrong assumption looks like
another effect: a servo that had no way to go looks infinitely fast. So the runs decide, between the two.
"""

from __future__ import annotations

from dataclasses import replace

from agvbench.diagnosis.estimation.score_test import first_order_gain
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.candidates import usual
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.stepwise import LEAST_GAIN, Selection, Selector
from agvbench.effects.variants import cause_of

SLOW_STEERING = ("steering_lag", "steering_rate_limit", "steering_backlash")
_LIKELY = 20.0


def choose_initial_steering(selector: Selector) -> Selector:
    """Return the selector, or one of runs whose axles stood at their first command where that predicts better by far.

    What is compared is the best of the effects to which it matters, as the first to be chosen.
    """
    names = [name for name in SLOW_STEERING if name in selector.candidates]
    base, other = selector.base(), under_other_initial_steering(selector)
    if set(SLOW_STEERING) & {cause_of(name) for name in selector.given}:
        return other if other.base().total < base.total - LEAST_GAIN else selector
    same = other.adopt(base)
    if max(_predicted_gain(other, same, name) for name in names) < _LIKELY:
        return selector
    at_neutral = min(selector.with_effect(base, name).total for name in names)
    at_first = min(other.with_effect(same, name).total for name in names)
    return other if at_first < at_neutral - LEAST_GAIN else selector


def reconsider_initial_steering(selection: Selection, selector: Selector) -> tuple[Selection, Selector]:
    """Select again under the other hypothesis where what was chosen predicts better by far under it."""
    chosen = selection.chosen
    if not set(SLOW_STEERING) & {cause_of(name) for name in chosen.names}:
        return selection, selector
    other = under_other_initial_steering(selector)
    if other.score(chosen.names, chosen.fit.parameters, None).total >= chosen.total - LEAST_GAIN:
        return selection, selector
    return other.select(), other


def under_other_initial_steering(selector: Selector) -> Selector:
    """Return a selector of the same runs under the other hypothesis."""
    batch = selector.batch
    readings = replace(batch.readings, preset=not batch.readings.preset)
    return selector.over(Batch(readings, batch.maps, batch.geometry, kinds=batch.kinds))


def _predicted_gain(selector: Selector, base: ScoredModel, name: str) -> float:
    predictor, candidate = Predictor(selector.batch, (*base.names, name)), usual(name)
    return max(first_order_gain(base.fit, predictor, start, candidate.bounds) for start in candidate.starts)
