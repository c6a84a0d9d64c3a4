"""The search for the run to drive next: among some hundred patterns, then by small changes of the best."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.design.alternatives import Alternative
from agvbench.diagnosis.design.criteria import (
    HEADINGS_RAD,
    evidence,
    information,
    like,
    simulated_readings,
    starts_within,
)
from agvbench.diagnosis.design.designs import Design, Levels, designs, levels_of, mutated
from agvbench.diagnosis.design.identifiability import Unidentified, pin_scores
from agvbench.diagnosis.estimation.fit import Fit
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import RANDOM_EFFECTS, Predictor
from agvbench.diagnosis.proposal import Discrimination
from agvbench.planning import Workspace
from agvbench.types import Floats, Pose

MIN_REPEATS = 4
"""As few repeats as a run is worth the way for."""

_SHOWS, _NOT_LOOKED_AT = 0.02, 1e3
_MAX_DIFFERENCE_M, _MAX_DIFFERENCE_RAD = 0.25, 0.35
_KEPT, _ROUNDS, _MUTANTS = 16, 3, 12


class Search:
    """Designs that fit on the floor, scored on demand."""

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
        """Return the designs that stay on the floor, whichever way they set off."""
        new = [d for d in dict.fromkeys(tried) if d not in self._starts]
        if new:
            readings = simulated_readings(new, [[Pose(0.0, 0.0, 0.0)]] * len(new), self.noise)
            paths = like(self.chosen, readings, self.geometry).predict(self.chosen.parameters)
            origin = np.zeros((1, 3))
            for design, path in zip(new, paths, strict=True):
                self._starts[design] = starts_within(np.concatenate([origin, path]), self.workspace, self.geometry)
        return [d for d in dict.fromkeys(tried) if self._starts[d] is not None]

    def starts(self, design: Design) -> list[Pose]:
        """Return where repeats of a design set off."""
        return self._starts[design] or []

    def readings(self, tried: Sequence[Design]) -> Readings:
        """Return the runs of designs from all of their starts."""
        return simulated_readings(tried, [self.starts(d) for d in tried], self.noise)

    def pair_scores(self, pairs: Sequence[tuple[Alternative, Alternative]], tried: Sequence[Design]) -> Floats:
        """Return the evidence per repeat (pairs, designs); that of designs which hardly differ is a lower bound.

        Models are linearised only on the designs where their predictions differ most, fitted again or not.
        """
        readings = self.readings(tried)
        fits = {id(r.fit): r.fit for pair in pairs for r in pair}
        poses = {key: like(f, readings, self.geometry).predict(f.parameters) for key, f in fits.items()}
        out = np.zeros((len(pairs), len(tried)))
        for k, (one, other) in enumerate(pairs):
            apart = poses[id(one.fit)] - poses[id(other.fit)]
            rough = self._rough(apart, len(tried))
            chosen = np.sort(np.argsort(-rough, kind="stable")[:_KEPT])
            some = self.readings([tried[i] for i in chosen])
            rows = np.isin(readings.group, chosen)
            gains = []
            for wrong, difference in ((one.fit, apart[rows]), (other.fit, -apart[rows])):
                new = information(wrong, like(wrong, some, self.geometry), wrong.parameters, difference)
                known = wrong.information.total
                gains.append(evidence(known, new, MIN_REPEATS) / MIN_REPEATS)
            out[k, chosen] = np.minimum(*gains) * _gentle(apart, len(tried))[chosen] ** 2
        return out

    def pin_scores(self, flat: Sequence[Unidentified], tried: Sequence[Design], repeats: int) -> Floats:
        """Return the expected standard errors over scales (len(flat), designs); large where not looked at."""
        chosen = self.chosen
        every = self.readings(tried)
        batch = Batch(every, chosen.predictor.maps, self.geometry)
        out = np.full((len(flat), len(tried)), np.inf)
        still = np.zeros((len(every), len(RANDOM_EFFECTS)))
        for k, item in enumerate(flat):
            names = (*chosen.predictor.effects, item.effect)
            _, slopes = Predictor(batch, names).by_last(np.r_[chosen.parameters, item.start], still, len(item.start))
            rough = self._rough(slopes[..., item.at], len(tried))
            # Not the largest only, which are the wildest: from those that show it at all, calm ones too.
            shows = np.flatnonzero(rough > _SHOWS * float(rough.max()))
            kept = shows[np.unique(np.linspace(0, len(shows) - 1, _KEPT).round().astype(int))]
            some = Batch(self.readings([tried[i] for i in kept]), chosen.predictor.maps, self.geometry)
            change = item.scale * slopes[..., item.at]
            gentle = _gentle(change, len(tried))[kept]
            out[k, kept] = pin_scores(chosen, [item], [Predictor(some, names)], repeats)[0] / gentle
        return np.where(np.isfinite(out), out, _NOT_LOOKED_AT)

    def _rough(self, apart: Floats, count: int) -> Floats:
        s = self.chosen.variance_components
        e = apart / np.array([s.position_m, s.position_m, s.heading_rad])
        return np.asarray(np.sum(e**2, axis=(1, 2)).reshape(count, len(HEADINGS_RAD)).mean(axis=1))

    def best(self, score: Callable[[Sequence[Design]], Floats]) -> Design:
        """Return the design with the largest score, from the patterns and then by small changes."""
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
        """Return how well a design parts each pair."""
        readings = self.readings([design])
        out = []
        for (one, other), gain in zip(pairs, gains, strict=True):
            a, b = (like(r.fit, readings, self.geometry).predict(r.fit.parameters) for r in (one, other))
            apart = a - b
            out.append(
                Discrimination(
                    (one.name, other.name),
                    float(gain),
                    float(1e3 * np.hypot(apart[..., 0], apart[..., 1]).max()),
                    float(np.degrees(np.abs(apart[..., 2]).max())),
                )
            )
        return tuple(out)


def _gentle(apart: Floats, count: int) -> Floats:
    """Return the share (D,) of the difference (R, K, 3) of predictions that counts.

    Predictions that part by decimetres are decided many times over, but are no longer near enough to one another for
    fits to find the way: beyond these limits more counts for no more.
    """
    position = np.hypot(apart[..., 0], apart[..., 1]).reshape(count, -1).max(axis=1)
    heading = np.abs(apart[..., 2]).reshape(count, -1).max(axis=1)
    most = np.maximum(position / _MAX_DIFFERENCE_M, heading / _MAX_DIFFERENCE_RAD)
    return np.asarray(1.0 / np.maximum(most, 1.0))
