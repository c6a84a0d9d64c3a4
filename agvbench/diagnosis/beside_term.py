"""Which effects of the library stand beside an empirical term."""

from __future__ import annotations

from agvbench.diagnosis.fitted_models import Scored
from agvbench.diagnosis.residuals import AT_THE_FLOOR, LACK_OF_FIT, floor, lack_of_fit, misses
from agvbench.diagnosis.selection import Selection, Selector
from agvbench.diagnosis.terms import TERMS, EmpiricalTerm

Settled = tuple[Scored, type[EmpiricalTerm], dict[str, float], dict[str, dict[str, float]]]
"""A model with a term, the term, the gains of the effects beside it, and their rivals."""

_MOST_RETRIED = 3
_MOST_NAMES = 5
_TERM_NAMES = frozenset(term.name for term in TERMS)


def settled(wide: Selector, selection: Selection, current: Scored, term: type[EmpiricalTerm]) -> Settled:
    """Return the model with the library's effects that earn their place beside the term, their gains and rivals.

    What was chosen without the term may only have been a rival of what is right beside it.
    """
    base = selection.base
    rivals: dict[str, dict[str, float]] = {}
    current = _unmasked(wide, current)
    again = [n for n in selection.chosen.names if n not in current.names]
    again += sorted(selection.rejected, key=lambda n: -selection.rejected[n])[:_MOST_RETRIED]
    for name in again:
        offer = wide.grown(current, name)
        if name not in current.names and wide.earns(current, offer):
            current = offer
    current, rivals = wide.exchanged(base, current, selection.rivals)
    while True:
        found = [n for n in current.names if n not in {*base.names, term.name}]
        smaller = {name: wide.shrunk(base, current, name) for name in found}
        gains = {name: model.total - current.total for name, model in smaller.items()}
        useless = [name for name, model in smaller.items() if not wide.earns(model, current)]
        if not useless:
            return current, term, gains, {name: rivals.get(name, {}) for name in gains}
        current = wide.left(smaller[min(useless, key=lambda name: gains[name])], current)


def _unmasked(wide: Selector, current: Scored) -> Scored:
    """Return the model with the effects that the unknown cause had hidden, as long as it misses more than scatter.

    An effect that gained nothing beside what was chosen first may stand out as soon as the term is there. All are asked
    for what they promise, and only the best are fitted.
    """
    while len(current.names) < _MOST_NAMES and lacks(current):
        names = [name for name in wide.candidates if name not in current.names and name not in _TERM_NAMES]
        promises = {name: wide.promise(current, name) for name in names}
        best = sorted(promises, key=lambda name: -promises[name])[:_MOST_RETRIED]
        offers = [wide.grown(current, name) for name in best if promises[name] > wide.least_gain]
        worthy = [offer for offer in offers if wide.earns(current, offer)]
        if not worthy:
            break
        current = min(worthy, key=lambda offer: offer.total)
    return current


def lacks(model: Scored) -> bool:
    """Whether what the model misses is above the scatter of repeats, and differs between groups beyond it."""
    predictor = model.fit.predictor
    missed = misses(predictor.readings, predictor.predict(model.fit.parameters))
    least, group = floor(missed, predictor.readings.group), predictor.readings.group
    p_value = lack_of_fit(missed, group)
    if least is None or p_value is None or p_value >= LACK_OF_FIT:
        return False
    return any(missed.rms()[name] > AT_THE_FLOOR * least[name] for name in ("position_rms_mm", "heading_rms_deg"))
