"""Priors of effects against the campaign: what each prior did, and which of them the campaign contradicts."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from agvbench.diagnosis.criteria import FIT, PRIOR, SELECTION
from agvbench.diagnosis.estimation.fit import Fit, fit
from agvbench.diagnosis.estimation.standard_errors import standard_errors
from agvbench.diagnosis.model.physical_priors import PhysicalPriors
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.result import NamedEffect, Verdict
from agvbench.diagnosis.selection.candidates import bounds_of
from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.effects import effect_kinds
from agvbench.effects.variants import weights_in
from agvbench.model.priors import Prior, is_limit
from agvbench.types import Floats


@dataclass(frozen=True)
class PriorCheck:
    """A prior beside the campaign.

    ``estimate`` is the quantity in the selected model, ``deviation`` its distance from the prior in standard deviations
    of the prior, and ``gain`` by how much the loss of the prior is smaller than without the effect. ``campaign`` and
    ``stderr`` are the estimate without the prior; NaN if the campaign hardly determines it. ``conflict`` is the
    distance between prior and campaign in combined standard deviations. ``note`` says why a prior was not used.
    """

    prior: Prior
    estimate: float = math.nan
    deviation: float = math.nan
    gain: float = 0.0
    campaign: float = math.nan
    stderr: float = math.nan
    conflict: float = 0.0
    note: str = ""

    @property
    def contradicted(self) -> bool:
        """Whether the campaign contradicts the prior."""
        return abs(self.conflict) > PRIOR.max_conflict

    def entry(self) -> dict[str, object]:
        """Return the entry in the provenance."""
        p = self.prior
        stated = {"effect": p.effect, "parameter": p.parameter, "value": p.value, "unit": p.unit}
        stated |= {"standard_deviation": p.standard_deviation, "source": p.source}
        if self.note:
            return stated | {"used": False, "note": self.note}
        campaign = None if math.isnan(self.stderr) else {"value": self.campaign, "stderr": self.stderr}
        found = {"used": True, "estimate": self.estimate, "deviation": self.deviation, "gain": self.gain}
        return stated | found | {"campaign": campaign, "contradicted": self.contradicted}

    def in_words(self) -> str:
        """Return the contradiction as one clause."""
        p, unit = self.prior, "" if self.prior.unit == "–" else f" {self.prior.unit}"
        stated = f"{p.value:.4g} ± {p.standard_deviation:.2g}{unit}"
        return (
            f"prior of {p.name} ({p.source}) says {stated}, the campaign {self.campaign:.4g} ± {self.stderr:.2g}{unit}"
        )


def check_priors(selection: Selection, tried: Collection[str]) -> tuple[PriorCheck, ...]:
    """Return each prior beside the campaign, under the selected model or a better one that priors exclude.

    Parameters
    ----------
    selection
        The selection.
    tried
        The effects that models may have; priors of others cannot be used.
    """
    chosen = selection.chosen.fit
    priors, own = chosen.predictor.readings.priors, chosen.parameters[chosen.predictor.maps.size :]
    physical = chosen.predictor.physical
    quantities, deviations = physical.quantities(own), physical.deviations(own)
    without = ((physical.null - physical.value) / physical.deviation) ** 2
    found = []
    for k, prior in enumerate(priors):
        if physical.silent[k]:
            found.append(PriorCheck(prior, note="the selected model variant has no such parameter"))
            continue
        if not physical.present[k] and prior.effect not in tried:
            found.append(PriorCheck(prior, note="the effect is read off the static maps, or does not apply"))
            continue
        check = PriorCheck(
            prior, _stated(prior, quantities[k]), float(deviations[k]), float(without[k] - deviations[k] ** 2)
        )
        better = _excluded_model(selection, prior)
        if better is not None:
            found.append(_without_priors(check, better, physical.value[k], physical.deviation[k]))
            continue
        found.append(_with_campaign(check, chosen if physical.present[k] else _with_effect(chosen, prior), k))
    return tuple(found)


def _excluded_model(selection: Selection, prior: Prior) -> Fit | None:
    """Return the model with the effect of the prior that predicts clearly better than the selected one without priors.

    A false prior may exclude the true cause, and leave one that fits worse.
    """
    models = [others[prior.effect] for others in selection.excluded.values() if prior.effect in others]
    best = max(models, key=lambda model: model.gain, default=None)
    return best.fit if best is not None and best.gain > SELECTION.alternative_margin else None


def _without_priors(check: PriorCheck, fitted: Fit, value: float, deviation: float) -> PriorCheck:
    """Return the check with the estimate of a model that was fitted without priors."""
    predictor = fitted.predictor
    own = fitted.parameters[predictor.maps.size :]
    physical = PhysicalPriors.of((check.prior,), predictor.effects, predictor.parameter_names, predictor.nulls)
    stderr = standard_errors(fitted, predictor.readings.group)[predictor.maps.size :]
    error = float(np.linalg.norm(physical.slopes(own)[0] * stderr))
    return _compared(check, float(physical.quantities(own)[0]), error, value, deviation)


def _with_effect(chosen: Fit, prior: Prior) -> Fit | None:
    """Return the selected model with the effect of the prior, fitted from the prior; None if that diverges."""
    names = (*chosen.predictor.effects, prior.effect)
    parameters = effect_kinds()[prior.effect].parameters()
    start = [prior.value if p.name == prior.parameter else float(np.clip(p.null, p.low, p.high)) for p in parameters]
    return _fitted(Predictor(chosen.predictor.batch, names), np.r_[chosen.parameters, start], chosen)


def _fitted(predictor: Predictor, parameters: Floats, near: Fit) -> Fit | None:
    try:
        return fit(
            predictor,
            parameters,
            bounds_of(predictor.effects),
            random_effects=near.random_effects,
            variance_components=near.variance_components,
            iterations=FIT.steps,
        )
    except np.linalg.LinAlgError:
        return None


def _with_campaign(check: PriorCheck, fitted: Fit | None, k: int) -> PriorCheck:
    """Return the check with the estimate of the campaign alone; `fitted` has the quantity of prior `k`.

    The estimate without the prior follows from the linearisation at the fit (deletion of one observation; Belsley, Kuh
    and Welsch 1980, section 2.1). A contradiction is confirmed by a fit without the prior.
    """
    if fitted is None:
        return check
    physical, maps = fitted.predictor.physical, fitted.predictor.maps.size
    own = fitted.parameters[maps:]
    value, deviation, slope = physical.value[k], physical.deviation[k], physical.slopes(own)[k]
    variance = float(slope @ fitted.covariance[maps:, maps:] @ slope)
    leverage = variance / deviation**2
    if leverage > PRIOR.max_leverage:
        return check
    alone = value + (float(physical.quantities(own)[k]) - value) / (1.0 - leverage)
    found = _compared(check, alone, math.sqrt(variance / (1.0 - leverage)), value, deviation)
    return _confirmed(found, fitted, k, alone) if found.contradicted else found


def _confirmed(check: PriorCheck, fitted: Fit, k: int, alone: float) -> PriorCheck:
    """Return the check with the estimate of a fit without prior `k`, which starts where the quantity is `alone`."""
    batch, maps = fitted.predictor.batch, fitted.predictor.maps.size
    physical, own = fitted.predictor.physical, fitted.parameters[maps:]
    slope = physical.slopes(own)[k]
    bounds = bounds_of(fitted.predictor.effects)
    moved = own + slope * (alone - float(physical.quantities(own)[k])) / float(slope @ slope)
    others = tuple(prior for i, prior in enumerate(batch.readings.priors) if i != k)
    predictor = Predictor(batch.with_priors(others), fitted.predictor.effects)
    start = np.r_[fitted.parameters[:maps], np.clip(moved, bounds[:, 0], bounds[:, 1])]
    without = _fitted(predictor, start, fitted)
    return check if without is None else _without_priors(check, without, physical.value[k], physical.deviation[k])


def _compared(check: PriorCheck, alone: float, error: float, value: float, deviation: float) -> PriorCheck:
    """Return the check with the quantity that the campaign says alone, and its standard error."""
    stated = _stated(check.prior, alone)
    scale = stated**2 if is_limit(check.prior) and math.isfinite(stated) else 1.0
    conflict = float((alone - value) / math.hypot(deviation, error))
    return replace(check, campaign=stated, stderr=float(scale * error), conflict=conflict)


def _stated(prior: Prior, quantity: float) -> float:
    """Return a quantity as the parameter that a prior states: that of a limit is a reciprocal."""
    if not is_limit(prior):
        return float(quantity)
    return 1.0 / float(quantity) if quantity > 0.0 else math.inf


def with_evidence(effects: Sequence[NamedEffect], checks: Sequence[PriorCheck]) -> tuple[NamedEffect, ...]:
    """Return the named effects with their priors in ``evidence.prior``, by parameter of the library."""
    found = []
    for effect in effects:
        form = str(effect.evidence.get("form", effect.name))
        own = {c.prior.parameter: _evidence(c) for c in checks if not c.note and weights_in(form, c.prior.name)}
        found.append(replace(effect, evidence={**effect.evidence, "prior": own}) if own else effect)
    return tuple(found)


def _evidence(check: PriorCheck) -> dict[str, object]:
    kept = ("value", "standard_deviation", "unit", "source", "estimate", "deviation", "gain", "contradicted")
    return {key: value for key, value in check.entry().items() if key in kept}


def with_contradictions(verdict: Verdict, why: str, checks: Sequence[PriorCheck]) -> tuple[Verdict, str]:
    """Return the verdict with its reason: UNKNOWN if the campaign contradicts a prior.

    Either the prior is false, or the model lacks something that resembles the effect.
    """
    clauses = [check.in_words() for check in checks if check.contradicted]
    if not clauses:
        return verdict, why
    rest = [why] if verdict is Verdict.UNKNOWN else []
    return Verdict.UNKNOWN, "; ".join(["the campaign contradicts a prior: " + ", and ".join(clauses), *rest])


def provenance_of(checks: Sequence[PriorCheck]) -> dict[str, object]:
    """Return the entry ``priors`` of the provenance; nothing without priors."""
    return {"priors": [check.entry() for check in checks]} if checks else {}
