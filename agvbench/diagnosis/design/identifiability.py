"""Parameters that the data at hand do not identify, and the standard errors that a run would give."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from agvbench.diagnosis.design.criteria import Weighted, information
from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.candidates import Candidate
from agvbench.effects import effect_kinds
from agvbench.effects.variants import cause_of
from agvbench.types import Floats

_WEAK = 1e-6
_MIN_CORRELATION = 0.99


@dataclass(frozen=True)
class Unidentified:
    """A parameter that the data do not identify.

    ``effect`` and ``parameter``: names. ``stderr``: expected from the data; ``scale``: typical size of the parameter.
    ``why``: the reason. ``start`` (q,): the effect's parameters at which it was computed; ``at``: index of the
    parameter among them. ``partner``: the selected parameter with the same influence on these runs, if there is one.
    """

    effect: str
    parameter: str
    stderr: float
    scale: float
    why: str
    start: Floats
    at: int
    partner: str = ""

    @property
    def name(self) -> str:
        """The full name, such as ``steering_lag.time_constant_s``."""
        return f"{self.effect}.{self.parameter}"


def unidentified(chosen: Fit, candidates: Mapping[str, Candidate]) -> list[Unidentified]:
    """Return the parameters of effects outside `chosen` that are not significant at their typical size.

    The derivatives of each effect are linearised about the chosen model, and projected on what maps, selected effects
    and random effects cannot absorb. Limits, with an infinite null value, are left out.
    """
    readings = chosen.predictor.readings
    weighted = Weighted(readings, readings.seen, chosen.linear.by_random_effects, chosen)
    own = weighted.columns(chosen.linear.by_parameters)
    known = chosen.information.total
    inverse = np.linalg.inv(known + _WEAK * np.eye(len(known)))
    kinds, selected = effect_kinds(), {cause_of(name) for name in chosen.predictor.effects}
    found = []
    for name, candidate in candidates.items():
        parameters = kinds[name].parameters()
        if name in selected or not np.isfinite([p.null for p in parameters]).all():
            continue
        # A direction has no effect near the null value of the drift.
        at_size = [0.0 if p.is_direction else p.scale for p in parameters]
        start = np.array(at_size) if any(p.is_direction for p in parameters) else candidate.starts[0]
        predictor = Predictor(chosen.predictor.batch, (*chosen.predictor.effects, name))
        _, slopes = predictor.by_last(np.r_[chosen.parameters, start], chosen.random_effects, len(start))
        weighted_slopes = weighted.columns(slopes)
        projected = weighted.without_random_effects(weighted_slopes)
        plain = np.einsum("ria,rib->ab", weighted_slopes, projected)
        cross = np.einsum("rip,ria->pa", own, projected)
        covariance = np.linalg.pinv(plain - cross.T @ inverse @ cross + _WEAK * np.diag(candidate.scale**-2.0))
        for k, p in enumerate(parameters):
            stderr = float(np.sqrt(max(covariance[k, k], 0.0)))
            if stderr > p.scale:
                share = np.sqrt(plain[k, k]) * p.scale
                partner = _partner(cross[:, k], plain[k, k], known, chosen)
                why = _why(share, partner)
                found.append(Unidentified(name, p.name, stderr, p.scale, why, start, k, partner))
    return found


def _partner(cross: Floats, plain: float, known: Floats, chosen: Fit) -> str:
    """Return the selected parameter with the same influence, if there is one."""
    correlation = np.abs(cross) / np.sqrt(np.maximum(np.diagonal(known) * plain, 1e-300))
    maps = chosen.predictor.maps.size
    names = chosen.predictor.parameter_names
    best = int(np.argmax(correlation[maps:])) if names else -1
    return names[best] if best >= 0 and correlation[maps + best] > _MIN_CORRELATION else ""


def _why(share: float, partner: str) -> str:
    if partner:
        return f"flat: {partner} does the same in these runs"
    if share < 1.0:
        return "never excited: at its usual size it would not show in any of these runs"
    return "flat: the maps, the other effects and the variation between runs can do the same"


def stderr_ratios(chosen: Fit, flat: Sequence[Unidentified], predictors: Sequence[Predictor], repeats: float) -> Floats:
    """Return the expected standard errors over scales (len(flat), designs) with `repeats` of each design.

    ``predictors`` are those of the chosen model with each of the parameters' effects added, for the designs' runs.
    """
    out = []
    known = chosen.information.total
    maps = len(chosen.parameters)
    for item, predictor in zip(flat, predictors, strict=True):
        new = information(chosen, predictor, np.r_[chosen.parameters, item.start])
        size = maps + len(item.start)
        base = np.zeros((size, size))
        base[:maps, :maps] = known
        # The information of the data at hand about the parameter itself is negligible, and left out.
        matrix = base + repeats * new.matrix + _WEAK * np.eye(size)
        inverse = np.linalg.inv(matrix)
        out.append(np.sqrt(np.maximum(inverse[:, maps + item.at, maps + item.at], 0.0)) / item.scale)
    return np.array(out)
