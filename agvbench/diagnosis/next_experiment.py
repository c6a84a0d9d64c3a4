"""The run to drive next: where rivals differ most, or where a parameter shows that nothing driven yet could show.

Rivals agree on the data at hand. How far a run not driven yet would part them is the quadratic form of the difference
of their predictions in noise and scatter, after the wrong one was fitted again (the criterion of Box and Hill, 1967,
with the parameters' uncertainty); the unit is that of the losses which rivals are judged by. The design that
maximises it for the pair that is hardest to part is searched for among some hundred patterns and then by small changes
of the best. A parameter is pinned by the design with the least expected standard error, relative to its scale.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from agvbench.diagnosis.candidates import Candidate
from agvbench.diagnosis.fitting import Fit
from agvbench.diagnosis.next_experiment_designs import SET_FIRST_S, Design, Levels, designs, levels_of, mutated
from agvbench.diagnosis.next_experiment_needs import what_it_takes
from agvbench.diagnosis.next_experiment_pins import Unpinned, pin_scores
from agvbench.diagnosis.next_experiment_rivals import Rival, rival_models
from agvbench.diagnosis.next_experiment_score import (
    HEADINGS_RAD,
    evidence,
    imagined,
    information,
    like,
    starts_within,
)
from agvbench.diagnosis.prediction import OFFSETS, Batch, Predictor
from agvbench.diagnosis.reading import Readings
from agvbench.planning import Trajectory, Workspace
from agvbench.planning.shapes import CommandTable
from agvbench.types import CommandUnit, Floats, Pose

DECISIVE = 40.0
"""Expected difference in minus two log likelihood that decides: it exceeds a rival's margin in 99 of 100 draws."""

HOPELESS = 10.0
"""What even `MOST_REPEATS` would not bring beyond this is not worth driving."""

LEAST_REPEATS, MOST_REPEATS = 4, 12
PINNED = 0.5
"""A parameter is pinned when its standard error is below this part of its usual size."""

_WELL_PINNED = 0.05
_SHOWS, _NOT_LOOKED_AT = 0.02, 1e3
_MOST_PINNED = 3
_UNKNOWN = 100.0
_FARTHEST_APART_M, _FARTHEST_APART_RAD = 0.25, 0.35
_KEPT, _ROUNDS, _MUTANTS = 16, 3, 12


@dataclass(frozen=True)
class Separation:
    """What the proposed run does for one pair of rivals.

    ``between`` their names; ``evidence`` expected in minus two log likelihood for all repeats; ``apart_mm`` and
    ``apart_deg``: the farthest that their predictions differ along it, before either is fitted again.
    """

    between: tuple[str, str]
    evidence: float
    apart_mm: float
    apart_deg: float


@dataclass(frozen=True)
class NextExperiment:
    """The run to drive: ``why`` in words, ``trajectory``, how many ``repeats`` and from which ``starts`` in turn.

    ``separates`` tells for each pair of rivals how well; ``pins`` which parameters it would pin.
    """

    why: str
    trajectory: Trajectory
    repeats: int
    starts: tuple[Pose, ...] = ()
    separates: tuple[Separation, ...] = ()
    pins: tuple[str, ...] = ()

    def to_table(self) -> dict[str, Any]:
        """Return what stands in the diagnosis' JSON."""
        return {
            "why": self.why,
            "trajectory": self.trajectory.to_table(),
            "repeats": self.repeats,
            "starts": [
                {
                    "x_m": round(p.x_m, 4),
                    "y_m": round(p.y_m, 4),
                    "heading_deg": round(float(np.degrees(p.heading_rad)), 2),
                }
                for p in self.starts
            ],
            "separates": [
                {
                    "between": list(s.between),
                    "evidence": round(s.evidence, 1),
                    "apart_mm": round(s.apart_mm, 2),
                    "apart_deg": round(s.apart_deg, 3),
                }
                for s in self.separates
            ],
            "pins": list(self.pins),
        }


@dataclass(frozen=True)
class Proposal:
    """What may be driven next, if anything can decide, and what no run can.

    ``inseparable`` pairs of rivals with what it would take to tell them apart.
    """

    experiment: NextExperiment | None = None
    inseparable: Mapping[tuple[str, str], str] = field(default_factory=dict)


def separate(
    chosen: Fit,
    rivals: Mapping[str, Mapping[str, float]],
    candidates: Mapping[str, Candidate],
    *,
    unit: CommandUnit,
    workspace: Workspace | None = None,
    seed: int = 0,
) -> Proposal:
    """Return the run that tells rivals apart, and which of them no run does.

    Parameters
    ----------
    chosen
        The model with every named effect.
    rivals
        By named effect, the effects that predict as well in its place, with how much worse they are.
    candidates
        Effects that were tried, by name.
    unit
        Of commands.
    workspace
        The floor; the circle of 6.1 m by default.
    seed
        Draws the changes that are tried.
    """
    pairs = rival_models(chosen, rivals, candidates)
    if not pairs:
        return Proposal()
    search = _Search(chosen, workspace or Workspace.circle(), seed)
    if not search.first:
        return Proposal(None, {_names(pair): "a floor on which the vehicle can move" for pair in pairs})
    # Each pair on its own first: a pair that nothing parts must not decide between designs for the others.
    table = search.pair_scores(pairs, search.first)
    most = MOST_REPEATS * table.max(axis=1)
    hopeless = {_names(p): what_it_takes(_names(p)) for p, m in zip(pairs, most, strict=True) if m < HOPELESS}
    parted = [p for p, m in zip(pairs, most, strict=True) if m >= HOPELESS]
    if not parted:
        return Proposal(None, hopeless)
    best = search.best(lambda tried: search.pair_scores(parted, tried).min(axis=0))
    each = search.pair_scores(parted, [best])[:, 0]
    repeats = int(np.clip(np.ceil(DECISIVE / max(float(each.min()), 1e-9)), LEAST_REPEATS, MOST_REPEATS))
    separations = search.separations(parted, best, each * repeats)
    hardest = min(separations, key=lambda s: s.evidence)
    why = (
        f"tells {' from '.join(hardest.between)}, whose predictions differ by up to {hardest.apart_mm:.1f} mm and "
        f"{hardest.apart_deg:.2f}° along it; {repeats} repeats should decide (expected {hardest.evidence:.0f}, "
        f"{DECISIVE:.0f} is decisive)"
    )
    names = "_or_".join(dict.fromkeys(name for s in separations for name in s.between))
    trajectory = as_trajectory(best, unit, f"next_{names}"[:60].rstrip("_"), "tells rivals apart")
    starts = search.starts(best)
    return Proposal(NextExperiment(why, trajectory, repeats, tuple(starts), separations), hopeless)


def pin(
    chosen: Fit,
    flat: Sequence[Unpinned],
    *,
    unit: CommandUnit,
    workspace: Workspace | None = None,
    seed: int = 0,
) -> NextExperiment | None:
    """Return the run that pins most of the parameters that the data leave open, or None where none does.

    Those that one of the effects found does the same as are left out: `separate` is for them.

    Parameters
    ----------
    chosen
        The model found.
    flat
        What `unpinned` returned.
    unit, workspace, seed
        As for `separate`.
    """
    wanted = [item for item in flat if not item.partner][:_MOST_PINNED]
    if not wanted:
        return None
    search = _Search(chosen, workspace or Workspace.circle(), seed)
    if not search.first:
        return None
    least = search.pin_scores(wanted, search.first, LEAST_REPEATS).min(axis=1)
    wanted = [item for item, value in zip(wanted, least, strict=True) if value < PINNED]
    if not wanted:
        return None

    def score(tried: Sequence[Design]) -> Floats:
        # Patterns come from calm to quick: of those that pin well enough, the calmest is driven.
        reached = search.pin_scores(wanted, tried, LEAST_REPEATS)
        return np.asarray(-np.log(np.maximum(reached, _WELL_PINNED)).sum(axis=0))

    best = search.best(score)
    reached = search.pin_scores(wanted, [best], LEAST_REPEATS)[:, 0]
    pins = tuple(item.name for item, value in zip(wanted, reached, strict=True) if value < PINNED)
    told = ", ".join(
        f"{item.name} to ± {value * item.scale:.2g} ({_now(item)} now)"
        for item, value in zip(wanted, reached, strict=True)
        if value < PINNED
    )
    if not pins:
        return None
    trajectory = as_trajectory(best, unit, "next_excitation", "excites what nothing driven so far excites")
    return NextExperiment(
        f"{LEAST_REPEATS} repeats would pin {told}", trajectory, LEAST_REPEATS, tuple(search.starts(best)), (), pins
    )


def _now(item: Unpinned) -> str:
    return "unknown" if item.stderr > _UNKNOWN * item.scale else f"± {item.stderr:.2g}"


def as_trajectory(design: Design, unit: CommandUnit, name: str, description: str) -> Trajectory:
    """Return a design in the trajectory schema."""
    table = CommandTable(unit=unit, rows=design.rows(), duration_s=round(design.duration_s, 3))
    return Trajectory(
        schema=1,
        name=name,
        description=description,
        conditions=("calibrated",),
        target="none",
        commands=table,
        steer_first_s=SET_FIRST_S,
    )


def _names(pair: tuple[Rival, Rival]) -> tuple[str, str]:
    return pair[0].name, pair[1].name


def _gentle(apart: Floats, count: int) -> Floats:
    """Return the share (D,) of the difference (R, K, 3) of predictions that counts.

    Predictions that part by decimetres are decided many times over, but are no longer near enough to one another for
    fits to find the way: beyond these limits more counts for no more.
    """
    position = np.hypot(apart[..., 0], apart[..., 1]).reshape(count, -1).max(axis=1)
    heading = np.abs(apart[..., 2]).reshape(count, -1).max(axis=1)
    most = np.maximum(position / _FARTHEST_APART_M, heading / _FARTHEST_APART_RAD)
    return np.asarray(1.0 / np.maximum(most, 1.0))


class _Search:
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
            readings = imagined(new, [[Pose(0.0, 0.0, 0.0)]] * len(new), self.noise)
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
        return imagined(tried, [self.starts(d) for d in tried], self.noise)

    def pair_scores(self, pairs: Sequence[tuple[Rival, Rival]], tried: Sequence[Design]) -> Floats:
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
                known = wrong.information.sum(axis=0)
                gains.append(evidence(known, new, LEAST_REPEATS) / LEAST_REPEATS)
            out[k, chosen] = np.minimum(*gains) * _gentle(apart, len(tried))[chosen] ** 2
        return out

    def pin_scores(self, flat: Sequence[Unpinned], tried: Sequence[Design], repeats: int) -> Floats:
        """Return the expected standard errors over scales (len(flat), designs); large where not looked at."""
        chosen = self.chosen
        every = self.readings(tried)
        batch = Batch(every, chosen.predictor.maps, self.geometry)
        out = np.full((len(flat), len(tried)), np.inf)
        still = np.zeros((len(every), len(OFFSETS)))
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
        s = self.chosen.scatter
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
        self, pairs: Sequence[tuple[Rival, Rival]], design: Design, gains: Floats
    ) -> tuple[Separation, ...]:
        """Return how well a design parts each pair."""
        readings = self.readings([design])
        out = []
        for (one, other), gain in zip(pairs, gains, strict=True):
            a, b = (like(r.fit, readings, self.geometry).predict(r.fit.parameters) for r in (one, other))
            apart = a - b
            out.append(
                Separation(
                    (one.name, other.name),
                    float(gain),
                    float(1e3 * np.hypot(apart[..., 0], apart[..., 1]).max()),
                    float(np.degrees(np.abs(apart[..., 2]).max())),
                )
            )
        return tuple(out)
