"""Search for the next experiment: some hundred initial designs, then small changes of the best."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from agvbench.diagnosis.criteria import DESIGN
from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.design.alternatives import Alternative
from agvbench.diagnosis.design.criteria import (
    HEADINGS_RAD,
    batch_like,
    evidence,
    information,
    predictor_like,
    simulated_readings,
    starts_within,
)
from agvbench.diagnosis.design.designs import Design, Levels, designs, levels_of, mutated
from agvbench.diagnosis.design.identifiability import Unidentified, stderr_ratios
from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor
from agvbench.diagnosis.proposal import Discrimination
from agvbench.planning import Workspace
from agvbench.types import Floats, Pose

_MIN_EFFECT, _NOT_EVALUATED = 0.02, 1e3
_MAX_DIFFERENCE_M, _MAX_DIFFERENCE_RAD = 0.25, 0.35
_EVALUATED, _ROUNDS, _MUTANTS = 16, 3, 12


class Search:
    """Designs that fit on the floor, with their scores."""

    def __init__(self, chosen: Fit, workspace: Workspace, seed: int) -> None:
        self.chosen, self.workspace = chosen, workspace
        self.geometry = chosen.predictor.batch.geometry
        self.rng = np.random.default_rng([0x2E47, seed])
        maps = chosen.predictor.maps
        self.levels: Levels = levels_of(maps, chosen.parameters[: maps.size])
        self.noise = np.asarray(np.median(chosen.predictor.readings.start_stderr, axis=0))
        self._starts: dict[Design, list[Pose] | None] = {}
        self.first = self.fitting(designs(self.levels))

    def fitting(self, tried: Sequence[Design]) -> list[Design]:
        """Return the designs that stay on the floor from every start heading."""
        new = [d for d in dict.fromkeys(tried) if d not in self._starts]
        if new:
            readings = simulated_readings(new, [[Pose(0.0, 0.0, 0.0)]] * len(new), self.noise)
            paths = predictor_like(self.chosen, readings, self.geometry).predict(self.chosen.parameters)
            origin = np.zeros((1, 3))
            for design, path in zip(new, paths, strict=True):
                self._starts[design] = starts_within(np.concatenate([origin, path]), self.workspace, self.geometry)
        return [d for d in dict.fromkeys(tried) if self._starts[d] is not None]

    def starts(self, design: Design) -> list[Pose]:
        """Return the start poses of the repeats of a design."""
        return self._starts[design] or []

    def readings(self, tried: Sequence[Design]) -> Readings:
        """Return the simulated runs of designs from all of their starts."""
        return simulated_readings(tried, [self.starts(d) for d in tried], self.noise)

    def _batch(self, readings: Readings) -> Batch:
        """Return simulated runs, packed for the chosen model and for its alternatives."""
        return batch_like(self.chosen, readings, self.geometry)

    def pair_scores(self, pairs: Sequence[tuple[Alternative, Alternative]], tried: Sequence[Design]) -> Floats:
        """Return the evidence per repeat (pairs, designs); zero for designs that were not evaluated.

        Models are linearised only on the designs where their predictions differ most.
        """
        readings = self.readings(tried)
        every = self._batch(readings)
        fits = {id(r.fit): r.fit for pair in pairs for r in pair}
        poses = {key: Predictor(every, f.predictor.effects).predict(f.parameters) for key, f in fits.items()}
        out = np.zeros((len(pairs), len(tried)))
        for k, (one, other) in enumerate(pairs):
            difference_of_pair = poses[id(one.fit)] - poses[id(other.fit)]
            approximate = self._approximate_evidence(difference_of_pair, len(tried))
            chosen = np.sort(np.argsort(-approximate, kind="stable")[:_EVALUATED])
            some = self._batch(self.readings([tried[i] for i in chosen]))
            rows = np.isin(readings.group, chosen)
            gains = []
            for wrong, difference in ((one.fit, difference_of_pair[rows]), (other.fit, -difference_of_pair[rows])):
                new = information(wrong, Predictor(some, wrong.predictor.effects), wrong.parameters, difference)
                known = wrong.information.total
                gains.append(evidence(known, new, DESIGN.min_repeats) / DESIGN.min_repeats)
            out[k, chosen] = np.minimum(*gains) * _limited_share(difference_of_pair, len(tried))[chosen] ** 2
        return out

    def stderr_ratios(self, flat: Sequence[Unidentified], tried: Sequence[Design], repeats: int) -> Floats:
        """Return the expected standard errors over scales (len(flat), designs); large for designs not evaluated."""
        chosen = self.chosen
        every = self.readings(tried)
        batch = self._batch(every)
        out = np.full((len(flat), len(tried)), np.inf)
        for k, item in enumerate(flat):
            names = (*chosen.predictor.effects, item.effect)
            predictor = Predictor(batch, names)
            _, slopes = predictor.by_last(
                np.r_[chosen.parameters, item.start], predictor.no_random_effects(), len(item.start)
            )
            approximate = self._approximate_evidence(slopes[..., item.at], len(tried))
            # Designs with a large effect are aggressive ones: evaluate some with a smaller effect, too.
            visible = np.flatnonzero(approximate > _MIN_EFFECT * float(approximate.max()))
            if not len(visible):
                continue  # no design shows it
            evaluated = visible[np.unique(np.linspace(0, len(visible) - 1, _EVALUATED).round().astype(int))]
            some = self._batch(self.readings([tried[i] for i in evaluated]))
            change = item.scale * slopes[..., item.at]
            share = _limited_share(change, len(tried))[evaluated]
            out[k, evaluated] = stderr_ratios(chosen, [item], [Predictor(some, names)], repeats)[0] / share
        return np.where(np.isfinite(out), out, _NOT_EVALUATED)

    def _approximate_evidence(self, difference: Floats, count: int) -> Floats:
        s = self.chosen.variance_components
        e = difference / np.array([s.position_m, s.position_m, s.heading_rad])
        return np.asarray(np.sum(e**2, axis=(1, 2)).reshape(count, len(HEADINGS_RAD)).mean(axis=1))

    def best(self, score: Callable[[Sequence[Design]], Floats]) -> Design:
        """Return the design with the largest score, from the initial designs and then by small changes."""
        values = score(self.first)
        best, value = self.first[int(np.argmax(values))], float(values.max())
        for _ in range(_ROUNDS):
            changed = [mutated(best, self.levels, self.rng) for _ in range(_MUTANTS)]
            near = [d for d in self.fitting(changed) if d != best]
            if not near:
                continue
            values = score(near)
            if float(values.max()) > value:
                best, value = near[int(np.argmax(values))], float(values.max())
        return best

    def separations(
        self, pairs: Sequence[tuple[Alternative, Alternative]], design: Design, gains: Floats
    ) -> tuple[Discrimination, ...]:
        """Return how well a design discriminates each pair."""
        batch = self._batch(self.readings([design]))
        out = []
        for (one, other), gain in zip(pairs, gains, strict=True):
            a, b = (Predictor(batch, r.fit.predictor.effects).predict(r.fit.parameters) for r in (one, other))
            difference = a - b
            out.append(
                Discrimination(
                    (one.name, other.name),
                    float(gain),
                    float(1e3 * np.hypot(difference[..., 0], difference[..., 1]).max()),
                    float(np.degrees(np.abs(difference[..., 2]).max())),
                )
            )
        return tuple(out)


def _limited_share(difference: Floats, count: int) -> Floats:
    """Return the share (D,) of the difference (R, K, 3) between predictions that counts.

    Predictions that differ by decimetres are discriminated with certainty, but the linearisation fails. Differences
    beyond these limits therefore do not increase the score.
    """
    position = np.hypot(difference[..., 0], difference[..., 1]).reshape(count, -1).max(axis=1)
    heading = np.abs(difference[..., 2]).reshape(count, -1).max(axis=1)
    most = np.maximum(position / _MAX_DIFFERENCE_M, heading / _MAX_DIFFERENCE_RAD)
    return np.asarray(1.0 / np.maximum(most, 1.0))
