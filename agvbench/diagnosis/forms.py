"""A cause keeps its name where its law is another: chosen effects are tried in their other forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agvbench.diagnosis.candidates import Candidate, bounds_of, candidate
from agvbench.diagnosis.empirical_terms import TERMS
from agvbench.diagnosis.fitting import fit
from agvbench.diagnosis.prediction import Batch, Predictor
from agvbench.diagnosis.selection import LEAST_GAIN, RIVAL_MARGIN, Scored, Selection, Selector
from agvbench.effects import Effect
from agvbench.effects.forms import Form, effect_forms

BEYOND: tuple[type[Effect], ...] = (*TERMS, *effect_forms().values())
"""What the widest simulation has beyond the library. One simulation for all, since each takes long to compile."""

_SHORT = 3


def form_candidates() -> dict[str, Candidate]:
    """Return every other law by its name, as effects are tried."""
    return {name: candidate(form) for name, form in effect_forms().items()}


def wider(selector: Selector) -> Selector:
    """Return a selector of the same runs whose simulation has empirical terms and other laws, too."""
    if selector.wide is None:
        batch = selector.batch
        selector.wide = Batch(batch.readings, batch.maps, batch.geometry, kinds=BEYOND)
    return Selector(
        selector.wide,
        dict(selector.candidates),
        selector.start,
        selector.seed,
        selector.tell,
        selector.given,
        selector.given_values,
    )


def reform(selection: Selection, selector: Selector) -> Selection:
    """Return the selection with laws that predict better in place of the library's, where they do.

    An effect beside it that only made up for the wrong law loses its place. The names of laws are their own; a
    diagnosis calls them by what they are forms of.
    """
    laws = [
        (name, form)
        for name in selection.chosen.names
        for form in effect_forms().values()
        if form.form_of == name and name not in selector.given
    ]
    if not laws:
        return selection
    wide, current = wider(selector), selection.chosen
    for name in dict(laws):
        offers = [_with_form(wide, selection, current, name, form) for cause, form in laws if cause == name]
        current = min(offers, key=lambda offer: offer.total + LEAST_GAIN * len(offer.names))
    if current.names == selection.chosen.names:
        return selection
    current, gains = wide.pruned(selection.base, current)
    better = selection.chosen.total - current.total
    rivals = {name: _rivals(selection, name, better) for name in gains}
    rejected = {n: g for n, g in selection.rejected.items() if n not in current.names}
    selector.candidates |= {n: c for n, c in form_candidates().items() if n in current.names}
    return Selection(selection.base, current, rivals, gains, rejected, selection.tried + wide.tried)


def _with_form(wide: Selector, selection: Selection, current: Scored, name: str, form: type[Form]) -> Scored:
    own = current.fit.effect_values()
    fitted = {key.partition(".")[2]: value for key, value in own.items() if key.partition(".")[0] == name}
    kind = candidate(form)
    starts = np.clip(np.array(form.starts(fitted)), kind.bounds[:, 0], kind.bounds[:, 1])
    wide.candidates[form.name] = replace(kind, starts=starts)
    offers = [(_swapped(wide, current, {name}, form.name), LEAST_GAIN)]
    # What stands beside a wrong law may only make up for it: the right law alone has to do as well, not better.
    others = [other for other in current.names if other != name and other not in wide.given]
    offers += [(_swapped(wide, current, {name, other}, form.name), -LEAST_GAIN) for other in others]
    worthy = [offer for offer, least in offers if offer.total < current.total - least]
    if not worthy:
        return current
    best = min(worthy, key=lambda offer: offer.total + LEAST_GAIN * len(offer.names))
    wide.tell(f"{' + '.join(best.names)}: another law gains {current.total - best.total:.0f}")
    return best


def _swapped(wide: Selector, current: Scored, out: set[str], form: str) -> Scored:
    """Return `current` with a law in place of the effects `out`, fitted from the scatter and offsets that it has."""
    own = current.fit.effect_values()
    kept = [value for key, value in own.items() if key.partition(".")[0] not in out]
    names = (*(name for name in current.names if name not in out), form)
    maps = current.fit.parameters[: wide.batch.maps.size]
    near = current.fit
    tries = [
        fit(
            Predictor(wide.batch, names), np.r_[maps, kept, start], bounds_of(wide.candidates, names),
            offsets=near.offsets, scatter=near.scatter, iterations=_SHORT,
        )
        for start in wide.candidates[form].starts
    ]  # fmt: skip
    best = min(tries, key=lambda one: float(one.loss.sum()))
    return wide.score(names, best.parameters, best)


def _rivals(selection: Selection, name: str, better: float) -> dict[str, float]:
    """Return who would still do in the place of the cause `name`, now that its law predicts better."""
    forms = effect_forms()
    cause = forms[name].form_of if name in forms else name
    known = selection.rivals.get(cause, {})
    return {other: worse + better for other, worse in known.items() if worse + better < RIVAL_MARGIN}
