"""A cause keeps its name where its law is another: chosen effects are tried in their other forms."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from agvbench.diagnosis.estimation.fit import fit
from agvbench.diagnosis.estimation.score_test import first_order_gain
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.candidates import Candidate, bounds_of, candidate, candidates
from agvbench.diagnosis.selection.fitted_models import ScoredModel
from agvbench.diagnosis.selection.initial_steering import SLOW_STEERING, under_other_initial_steering
from agvbench.diagnosis.selection.stepwise import ALTERNATIVE_MARGIN, LEAST_GAIN, Selection, Selector
from agvbench.diagnosis.terms import TERMS
from agvbench.effects import Effect
from agvbench.effects.variants import Variant, cause_of, effect_variants
from agvbench.model import VehicleModel
from agvbench.types import Floats

BEYOND: tuple[type[Effect], ...] = (*TERMS, *effect_variants().values())
"""What the widest simulation has beyond the library. One simulation for all, since each takes long to compile."""

_SHORT = 3
_LIKELY = 40.0  # a cause that fits so much better is tried in its other laws even if it predicts no better
_MOST_ALONE = 3
_HALF = 0.5  # of what an effect gains: another cause that gains less in its place is not tried in its other laws


def form_candidates() -> dict[str, Candidate]:
    """Return every other law by its name, as effects are tried."""
    return {name: candidate(variant) for name, variant in effect_variants().items()}


def tried_beside(vehicle: VehicleModel | None) -> tuple[dict[str, Candidate], tuple[type[Effect], ...]]:
    """Return the effects to be tried on a vehicle, and what its simulation needs beyond the library.

    An effect that the vehicle has in another law is among them in that law, and not in the library's.
    """
    carried = {effect.name for effect in (vehicle.effects if vehicle else ()) if not effect.is_null}
    laws = {name: law for name, law in form_candidates().items() if name in carried}
    known = {effect_variants()[name].variant_of for name in laws}
    return candidates(exclude=known) | laws, BEYOND if laws else ()


def wider(selector: Selector) -> Selector:
    """Return a selector of the same runs whose simulation has empirical terms and other laws, too."""
    batch = selector.batch
    if selector.wide is None:
        whole = {*BEYOND} <= {*batch.kinds}
        selector.wide = batch if whole else Batch(batch.readings, batch.maps, batch.geometry, kinds=BEYOND)
    return selector.over(selector.wide)


@dataclass(frozen=True)
class _Law:
    """A law that may take the place of the effect called ``out``, fitted from ``starts`` (n, p)."""

    out: str
    variant: type[Variant]
    starts: Floats


def select_variants(selection: Selection, selector: Selector) -> Selection:
    """Return the selection with laws that predict better in place of the library's, where they do.

    An effect beside it that only compensated for the wrong law is removed. The names of laws are their own; a
    diagnosis calls them by what they are forms of.
    """
    found = [name for name in selection.chosen.names if name not in selector.given]
    if not found:
        return _another_law_alone(selection, selector)
    wide, current = wider(selector), selection.chosen
    laws = [law for name in found for law in _laws(selection, selector, wide, name)]
    offered: list[tuple[_Law, ScoredModel]] = []
    for name in found:
        for law in laws:
            if law.out == name and name in current.names:
                offered += [(law, offer) for offer in _offers(wide, current, law)]
        current = _best(wide, current, [offer for law, offer in offered if law.out == name])
    if current.names == selection.chosen.names:
        return selection
    current, gains = wide.backward_elimination(selection.base, current)
    better = selection.chosen.total - current.total
    alternatives = {
        name: _alternatives(selection, name, better) | _other_causes(current, name, offered) for name in gains
    }
    # What another cause's law has replaced may still be right beside a term that is found later.
    causes = {cause_of(n) for n in current.names}
    rejected = {n: g for n, g in (selection.rejected | selection.gains).items() if n not in causes}
    selector.candidates |= {n: c for n, c in form_candidates().items() if n in current.names}
    return Selection(selection.base, current, alternatives, gains, rejected, selection.tried + wide.tried)


def _another_law_alone(selection: Selection, selector: Selector) -> Selection:
    """Return the selection with a law whose cause fits much better in the library's law, and predicts no better.

    A cause that is strong, and of another law, pulls the maps along: what they then say of runs left out is far off.
    """
    base = selection.base
    known = ((variant, selector.known((*base.names, variant.variant_of))) for variant in effect_variants().values())
    fitted = [(_explained(base, model), variant, model) for variant, model in known if model]
    likely = sorted((one for one in fitted if one[0] > _LIKELY), key=lambda one: -one[0])[:_MOST_ALONE]
    if not likely:
        return selection
    wide = wider(selector)
    worthy = [
        (law, offer)
        for law, model in (
            (_Law(variant.variant_of, variant, _starts_near(variant, model)), model) for _, variant, model in likely
        )
        for offer in _offers(wide, model, law)
        if wide.meets_criterion(base, offer)
    ]
    if not worthy:
        return selection
    law, best = min(worthy, key=lambda pair: pair[1].total)
    name, gain = law.variant.name, base.total - best.total
    wide.on_progress(f"{name}: gains {gain:.0f}")
    selector.candidates[name] = form_candidates()[name]
    rejected = {n: g for n, g in selection.rejected.items() if n != law.out}
    alternatives = {name: _other_causes(best, name, worthy)}
    return Selection(base, best, alternatives, {name: gain}, rejected, selection.tried + wide.tried)


def select_variants_and_reconsider(selection: Selection, selector: Selector) -> tuple[Selection, Selector]:
    """Select variants, and select again under the other initial steering if that is better now.

    In the wrong law a slow servo may look as if it had stood elsewhere.
    """
    varied = select_variants(selection, selector)
    if varied is selection or not under_other_start(varied.chosen, selector):
        return varied, selector
    again, other = selected_under_other_start(selector)
    return (again, other) if again.chosen.total < varied.chosen.total else (varied, selector)


def under_other_start(chosen: ScoredModel, selector: Selector) -> bool:
    """Whether a model with slow steering predicts better by far under the other initial steering."""
    if not {*SLOW_STEERING} & {cause_of(name) for name in chosen.names}:
        return False
    there = under_other_initial_steering(wider(selector))
    return there.score(chosen.names, chosen.fit.parameters, None).total < chosen.total - LEAST_GAIN


def selected_under_other_start(selector: Selector) -> tuple[Selection, Selector]:
    """Return what is selected under the other initial steering, and its selector."""
    other = under_other_initial_steering(selector)
    other.candidates = {n: c for n, c in other.candidates.items() if n not in effect_variants() or n in selector.given}
    return select_variants(other.select(), other), other


def _laws(selection: Selection, selector: Selector, wide: Selector, name: str) -> Iterator[_Law]:
    """Yield other laws of the cause `name`, and of others with half its gain, or half of it predicted."""
    chosen = selection.chosen
    rest = selector.without_effect(selection.base, chosen, name)
    models = {name: chosen} | {
        other: selector.with_effect(rest, other) for other in selector.candidates if other not in chosen.names
    }
    for variant in effect_variants().values():
        if (model := models.get(variant.variant_of)) is None:
            continue
        kind, term_selection = candidate(variant), _explained(rest, chosen)
        # A strong cause of another law fits well, and predicts badly.
        if rest.total - model.total >= _HALF * (rest.total - chosen.total) or (
            _explained(rest, model) >= _HALF * term_selection
        ):
            yield _Law(name, variant, _starts_near(variant, model))
            continue
        # The library's law may fail where another does not.
        larger = Predictor(wide.batch, (*rest.names, variant.name))
        predicted_gains = [first_order_gain(rest.fit, larger, start, kind.bounds) for start in kind.starts]
        if max(predicted_gains) >= _HALF * term_selection:
            yield _Law(name, variant, kind.starts[[int(np.argmax(predicted_gains))]])


def _explained(without: ScoredModel, model: ScoredModel) -> float:
    """Return by how much `model` fits better, whatever it predicts."""
    return float(without.fit.loss.sum() - model.fit.loss.sum())


def _starts_near(variant: type[Variant], model: ScoredModel) -> Floats:
    """Return starts (n, p) of a law near the library's, as `model` has it."""
    bounds = candidate(variant).bounds
    starts: Floats = np.clip(np.array(variant.starts(_values(model, variant.variant_of))), bounds[:, 0], bounds[:, 1])
    return starts


def _values(model: ScoredModel, name: str) -> dict[str, float]:
    own = model.fit.effect_values()
    return {key.partition(".")[2]: value for key, value in own.items() if key.partition(".")[0] == name}


def _offers(wide: Selector, current: ScoredModel, law: _Law) -> list[ScoredModel]:
    """Return `current` with a law in its place, and with it in place of one effect more each."""
    variant = replace(candidate(law.variant), starts=law.starts)
    # What stands beside a wrong law may only compensate for it.
    others = [other for other in current.names if other != law.out and other not in wide.given]
    return [_swapped(wide, current, {law.out, *more}, variant) for more in ([], *([other] for other in others))]


def _best(wide: Selector, current: ScoredModel, offers: list[ScoredModel]) -> ScoredModel:
    """Return the best offer; one with fewer effects than `current` has to do as well as it, not better."""
    worthy = [offer for offer in offers if _does(offer, current)]
    best = min((current, *worthy), key=lambda offer: offer.total + LEAST_GAIN * len(offer.names))
    if best is current:
        return current
    wide.on_progress(f"{' + '.join(best.names)}: another law gains {current.total - best.total:.0f}")
    return best


def _does(offer: ScoredModel, current: ScoredModel) -> bool:
    """Whether an offer is better than `current` or, with fewer effects, predicts about as well."""
    if len(offer.names) < len(current.names):
        return offer.total < current.total + LEAST_GAIN
    return offer.gain_over(current) > LEAST_GAIN


def _swapped(wide: Selector, current: ScoredModel, out: set[str], variant: Candidate) -> ScoredModel:
    """Return `current` with a law in place of the effects `out`, fitted from its variance components and offsets."""
    own = current.fit.effect_values()
    kept = [value for key, value in own.items() if key.partition(".")[0] not in out]
    names = (*(name for name in current.names if name not in out), variant.name)
    starts = frozenset(start for start in current.starts if start[0] not in out) | variant.key
    maps = current.fit.parameters[: wide.batch.maps.size]
    near = current.fit
    tries = [
        fit(
            Predictor(wide.batch, names), np.r_[maps, kept, start], bounds_of(names),
            random_effects=near.random_effects, variance_components=near.variance_components, iterations=_SHORT,
        )
        for start in variant.starts
    ]  # fmt: skip
    best = min(tries, key=lambda one: float(one.loss.sum()))
    return wide.score(names, best.parameters, best, starts=starts)


def _alternatives(selection: Selection, name: str, better: float) -> dict[str, float]:
    """Return the effects that still do in the place of the cause `name`, now that its law predicts better."""
    known = selection.alternatives.get(cause_of(name), {})
    return {other: worse + better for other, worse in known.items() if worse + better < ALTERNATIVE_MARGIN}


def _other_causes(current: ScoredModel, name: str, offered: list[tuple[_Law, ScoredModel]]) -> dict[str, float]:
    """Return other causes one of whose laws would do as well in the place of `name`."""
    beside = {*current.names} - {name}
    return {
        law.variant.variant_of: offer.total - current.total
        for law, offer in offered
        if {*offer.names} - {law.variant.name} == beside
        and law.variant.variant_of != cause_of(name)
        and offer.total - current.total < ALTERNATIVE_MARGIN
    }
