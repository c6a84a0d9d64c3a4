"""Alternative models, each refitted to the data at hand."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from agvbench.diagnosis.criteria import SELECTION
from agvbench.diagnosis.estimation.fit import Fit, fit_near
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.candidates import Candidate, bounds_of, candidate
from agvbench.diagnosis.selection.variants import simulated_variants
from agvbench.effects.variants import cause_of

_FEW_ITERATIONS, _MANY_ITERATIONS = 2, 8
_MAX_PAIRS = 3


@dataclass(frozen=True)
class Alternative:
    """A fitted model with the effect ``name`` in the place of ``instead_of``, each in any of its equations."""

    name: str
    instead_of: str
    fit: Fit


def alternative_models(
    chosen: Fit, alternatives: Mapping[str, Mapping[str, float]], candidates: Mapping[str, Candidate]
) -> list[tuple[Alternative, Alternative]]:
    """Return the pairs of models to discriminate: named effects, their alternatives, and alternatives among themselves.

    Parameters
    ----------
    chosen
        The model with every named effect.
    alternatives
        By named effect, the effects that predict as well in its place.
    candidates
        Bounds and initial values of effects, by name.
    """
    pairs = []
    for name, others in alternatives.items():
        group = [Alternative(name, name, chosen)]
        fits = {other: swapped(chosen, name, other, candidates) for other in others}
        group += [Alternative(other, name, own) for other, own in fits.items() if own is not None]
        # Pairs with the named effect come first; the others are left to a later experiment.
        pairs += list(combinations(group, 2))[: max(_MAX_PAIRS, len(others))]
    return pairs


def swapped(chosen: Fit, name: str, other: str, candidates: Mapping[str, Candidate]) -> Fit | None:
    """Return the model with the effect `other` in the place of `name`, fitted from the best of its starts.

    Of `other` it has the library's equation. If that does not predict as well, it has the best of the equations that
    the model simulates, by Akaike's criterion. None if the fits diverge from all starts.
    """
    found = _with_equation(chosen, name, candidates[other])
    if found is not None and found.total_loss < chosen.total_loss + SELECTION.alternative_margin:
        return found
    variants = [kind for kind in simulated_variants(chosen.predictor.batch) if kind.variant_of == other]
    fits = [found, *(_with_equation(chosen, name, candidate(kind)) for kind in variants)]
    return min((own for own in fits if own is not None), key=_akaike, default=None)


def _akaike(fitted: Fit) -> float:
    return fitted.total_loss + 2.0 * len(fitted.parameters)


def _with_equation(chosen: Fit, name: str, equation: Candidate) -> Fit | None:
    """Return the model with an `equation` in the place of that of the effect `name`; None if the fits diverge."""
    replaced = equation_of(chosen, name)
    names = (*(n for n in chosen.predictor.effects if n != replaced), equation.name)
    predictor = Predictor(chosen.predictor.batch, names)
    bounds = bounds_of(names)
    kept = [value for key, value in chosen.effect_values().items() if key.partition(".")[0] != replaced]
    maps = chosen.parameters[: chosen.predictor.maps.size]

    found = []
    for start in equation.starts:
        with suppress(np.linalg.LinAlgError):
            parameters = np.r_[maps, kept, start]
            found.append(fit_near(chosen, predictor, parameters, bounds, iterations=_FEW_ITERATIONS))
    if not found:
        return None
    best = min(found, key=lambda f: f.total_loss)
    try:
        return fit_near(best, predictor, best.parameters, bounds, iterations=_MANY_ITERATIONS)
    except np.linalg.LinAlgError:
        return best


def equation_of(fitted: Fit, name: str) -> str:
    """Return which of a model's effects is the effect `name` of the library, or a variant of it.

    Raises
    ------
    KeyError
        If the model has no such effect.
    """
    return {cause_of(own): own for own in fitted.predictor.effects}[name]
