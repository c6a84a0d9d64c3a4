"""Parameters of the selected effects, with standard errors and notes."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from agvbench.diagnosis.criteria import SELECTION
from agvbench.diagnosis.estimation.standard_errors import standard_errors
from agvbench.diagnosis.findings.omitted_effects import OmittedEffect, contributed_stderr
from agvbench.diagnosis.result import Estimate, NamedEffect
from agvbench.diagnosis.selection.stepwise import Selection
from agvbench.diagnosis.terms import TERMS, DiscrepancyTerm
from agvbench.effects import Effect, effect_kinds
from agvbench.effects.variants import cause_of, effect_variants
from agvbench.types import Floats

_MAX_RELATIVE_STDERR = 3.0


def named_effects(
    selection: Selection, bounds: Floats, omitted: Mapping[str, OmittedEffect]
) -> tuple[NamedEffect, ...]:
    """Return the selected effects, with estimates and their standard uncertainties.

    These combine the standard errors of `standard_errors` with what the effects that the model omits contribute.
    """
    fit = selection.chosen.fit
    maps = fit.predictor.maps.size
    stderr = np.hypot(
        standard_errors(fit, fit.predictor.readings.group), contributed_stderr(omitted.values(), len(fit.parameters))
    )
    kinds: dict[str, type[Effect]] = {**effect_kinds(), **effect_variants(), **{term.name: term for term in TERMS}}
    at = 0
    found = []
    for name in selection.chosen.names:
        estimates = {}
        for p in kinds[name].parameters():
            value, error = float(fit.parameters[maps + at]), float(stderr[maps + at])
            note = _note(value, error, bounds[at], p.scale)
            value = math.remainder(value, math.tau) if p.is_direction else value
            estimates[p.name] = Estimate(value, error, p.unit, note)
            at += 1
        if name in selection.base.names or issubclass(kinds[name], DiscrepancyTerm):
            continue  # a given effect, or a discrepancy term
        alternatives = sorted(selection.alternatives[name].items(), key=lambda pair: pair[1])
        found.append(
            NamedEffect(
                cause_of(name),
                estimates,
                tuple(alternative for alternative, _ in alternatives),
                {
                    "loss_without_it": selection.gains[name],
                    "rival_margin": SELECTION.alternative_margin,
                    **({"form": name} if name in effect_variants() else {}),
                    **{f"{alternative}_instead": worse for alternative, worse in alternatives},
                    **({"excluded_by_priors": sorted(selection.excluded[name])} if name in selection.excluded else {}),
                },
            )
        )
    return tuple(found)


def _note(value: float, stderr: float, bounds: Floats, scale: float) -> str:
    if value <= bounds[0] or value >= bounds[1]:
        return "at its bound"
    if stderr > _MAX_RELATIVE_STDERR * scale:
        return "the data hardly pin it"
    return ""
