"""Effects that a chosen model omits: how large they may be, and how uncertain that makes its parameters.

A selection omits an effect that gains too little, and another one absorbs a part of it. The standard errors of the
chosen model do not know of this: they hold if every omitted effect is exactly null. Its contribution to the standard
uncertainty is a systematic one (type B of the GUM, JCGM 100:2008, section 4.3).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.estimation.score_test import OneStepEstimate, one_step_estimate
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.selection.candidates import DIRECTIONS, candidates
from agvbench.effects import Effect, effect_kinds
from agvbench.effects.variants import cause_of
from agvbench.types import Floats


@dataclass(frozen=True)
class OmittedEffect:
    """An effect that the model omits: ``nulls``, typical sizes (q,), and an estimate for each possible direction."""

    nulls: Floats
    scales: Floats
    estimates: tuple[OneStepEstimate, ...]

    def contribution(self) -> Floats:
        """Return the variance (P,) that the effect contributes to the parameters of the chosen model.

        The effect counts by the size that it has at least: the near end of its 95 % interval, and nothing if that
        contains the null value. A single Newton step may lead far beyond the typical size, which is the limit. The
        direction counts that contributes most.
        """
        sizes = [np.minimum(one.sizes_from(self.nulls)[0], self.scales) for one in self.estimates]
        by_direction = [one.influence**2 @ size**2 for one, size in zip(self.estimates, sizes, strict=True)]
        return np.asarray(np.max(by_direction, axis=0))


def omitted_effects(chosen: Fit) -> dict[str, OmittedEffect]:
    """Return the effects of the library that `chosen` omits, by name, each estimated by one Newton step beside it.

    Maps, other effects and random effects are refitted. Limits, with an infinite null value, have no such estimate.
    """
    predictor = chosen.predictor
    present = {cause_of(name) for name in predictor.effects}
    found = {}
    for name in candidates(predictor.batch.geometry):
        kind = effect_kinds()[name]
        parameters = kind.parameters()
        if name in present or any(math.isinf(p.null) for p in parameters):
            continue
        larger = Predictor(predictor.batch, (*predictor.effects, name))
        free = np.array([not p.is_direction for p in parameters])
        group = predictor.readings.group
        try:
            estimates = tuple(one_step_estimate(chosen, larger, start, free, group) for start in _small_starts(kind))
        except np.linalg.LinAlgError:
            continue  # nothing is known of what cannot be evaluated
        nulls = np.where(free, [p.null for p in parameters], estimates[0].estimate)
        found[name] = OmittedEffect(nulls, np.array([p.scale for p in parameters]), estimates)
    return found


def contributed_stderr(omitted: Iterable[OmittedEffect], size: int) -> Floats:
    """Return the standard uncertainty (size,) that omitted effects contribute to the parameters of the model."""
    return np.sqrt(sum((effect.contribution() for effect in omitted), start=np.zeros(size)))


def _small_starts(kind: type[Effect]) -> list[Floats]:
    """Return the initial values (q,) near null about which an effect is linearised: one for each direction."""
    small = [0.0 if p.is_direction else p.null + 0.1 * p.scale for p in kind.parameters()]
    at = [k for k, p in enumerate(kind.parameters()) if p.is_direction]
    starts = [np.array(small) for _ in (DIRECTIONS if at else DIRECTIONS[:1])]
    for start, direction in zip(starts, DIRECTIONS, strict=False):
        start[at] = direction
    return starts
