"""Parameters that the data at hand cannot pin, and how well a run would."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from agvbench.diagnosis.design.criteria import Weighted, information
from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.candidates import Candidate
from agvbench.effects import effect_kinds
from agvbench.types import Floats

_WEAK = 1e-6
_SAME = 0.99


@dataclass(frozen=True)
class Unidentified:
    """A parameter that the data do not pin.

    ``effect`` and ``parameter``; ``stderr`` expected from the data, and ``scale`` the size that such an effect
    usually has; ``why`` in words; ``start`` (q,) the effect's parameters where that was computed; ``at`` the
    parameter's number among them; ``partner`` the parameter that does the same here, if one does.
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
        """Such as ``steering_lag.time_constant_s``."""
        return f"{self.effect}.{self.parameter}"


def unidentified(chosen: Fit, candidates: Mapping[str, Candidate]) -> list[Unidentified]:
    """Return the parameters of effects that `chosen` lacks which would not show at their usual size.

    To first order about the chosen model: each effect's slopes, freed of what maps, effects found and the runs' own
    offsets can absorb. Limits, whose null is infinite, are left out: they show where they act or nowhere.
    """
    readings = chosen.predictor.readings
    weighted = Weighted(readings, readings.seen, chosen.linear.by_random_effects, chosen)
    own = weighted.columns(chosen.linear.by_parameters)
    known = chosen.information.total
    inverse = np.linalg.inv(known + _WEAK * np.eye(len(known)))
    kinds = effect_kinds()
    found = []
    for name, candidate in candidates.items():
        parameters = kinds[name].parameters()
        if name in chosen.predictor.effects or not np.isfinite([p.null for p in parameters]).all():
            continue
        start = candidate.starts[0]
        predictor = Predictor(chosen.predictor.batch, (*chosen.predictor.effects, name))
        _, slopes = predictor.by_last(np.r_[chosen.parameters, start], chosen.random_effects, len(start))
        slope = weighted.columns(slopes)
        fixed = weighted.without_random_effects(slope)
        plain = np.einsum("ria,rib->ab", slope, fixed)
        cross = np.einsum("rip,ria->pa", own, fixed)
        left = np.linalg.pinv(plain - cross.T @ inverse @ cross + _WEAK * np.diag(candidate.scale**-2.0))
        for k, p in enumerate(parameters):
            stderr = float(np.sqrt(max(left[k, k], 0.0)))
            if stderr > p.scale:
                share = np.sqrt(plain[k, k]) * p.scale
                partner = _partner(cross[:, k], plain[k, k], known, chosen)
                why = _why(share, partner)
                found.append(Unidentified(name, p.name, stderr, p.scale, why, start, k, partner))
    return found


def _partner(cross: Floats, plain: float, known: Floats, chosen: Fit) -> str:
    """Return the effect found that alone does what the parameter does, if one does."""
    alike = np.abs(cross) / np.sqrt(np.maximum(np.diagonal(known) * plain, 1e-300))
    maps = chosen.predictor.maps.size
    names = chosen.predictor.parameter_names
    best = int(np.argmax(alike[maps:])) if names else -1
    return names[best] if best >= 0 and alike[maps + best] > _SAME else ""


def _why(share: float, partner: str) -> str:
    if partner:
        return f"flat: {partner} does the same in these runs"
    if share < 1.0:
        return "never excited: at its usual size it would not show in any of these runs"
    return "flat: the maps, the other effects and the variation between runs can do the same"


def pin_scores(chosen: Fit, flat: Sequence[Unidentified], predictors: Sequence[Predictor], repeats: float) -> Floats:
    """Return the expected standard errors over scales (len(flat), designs) with so many repeats of each design.

    ``predictors`` are the chosen model with each of the parameters' effects added, for the designs' runs.
    """
    out = []
    known = chosen.information.total
    maps = len(chosen.parameters)
    for item, predictor in zip(flat, predictors, strict=True):
        new = information(chosen, predictor, np.r_[chosen.parameters, item.start])
        size = maps + len(item.start)
        base = np.zeros((size, size))
        base[:maps, :maps] = known
        # What the data say about the parameter itself is next to nothing, and is taken as that.
        matrix = base + repeats * new.matrix + _WEAK * np.eye(size)
        inverse = np.linalg.inv(matrix)
        out.append(np.sqrt(np.maximum(inverse[:, maps + item.at, maps + item.at], 0.0)) / item.scale)
    return np.array(out)
