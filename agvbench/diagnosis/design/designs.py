"""Designs: candidate runs with command levels of the campaign, in various orders and durations."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from agvbench.diagnosis.model.nodal_maps import NodalMaps
from agvbench.types import Command, Commands, Floats

SET_FIRST_S = 0.4
MAX_DURATION_S = 9.0
_MIN_STEP_S = 0.3
_MAX_STEPS = 14
_RHYTHMS_S = (2.4, 1.2, 0.6, 0.3)
_MAX_ANGLE_RAD = 0.6
Step = tuple[float, float, float, float]


@dataclass(frozen=True)
class Levels:
    """Command levels of a design: ``drive`` (forward and backward, fast and slow), ``front`` and ``rear``.

    With ``turns_on_the_spot`` the front command moves the vehicle, as the yaw rate of a differential one does.
    """

    drive: tuple[float, ...]
    front: tuple[float, ...]
    rear: tuple[float, ...]
    neutral: Command
    turns_on_the_spot: bool = False


@dataclass(frozen=True)
class Design:
    """``steps`` of duration [s], drive, front, rear; the vehicle is at rest before and after, with its axles set.

    A vehicle that ``turns_on_the_spot`` has no axles to set.
    """

    steps: tuple[Step, ...]
    neutral: Command
    turns_on_the_spot: bool = False

    @property
    def duration_s(self) -> float:
        """The time of the stop [s]."""
        return self._set_first_s + sum(step[0] for step in self.steps)

    @property
    def _set_first_s(self) -> float:
        return 0.0 if self.turns_on_the_spot else SET_FIRST_S

    def rows(self) -> tuple[tuple[float, float, float, float], ...]:
        """Return rows of t_s, drive, front, rear, without the stop."""
        _, _, front, rear = self.steps[0]
        rows = [] if self.turns_on_the_spot else [(0.0, self.neutral.drive, front, rear)]
        at = self._set_first_s
        for duration, *command in self.steps:
            if not rows or tuple(command) != rows[-1][1:]:
                rows.append((round(at, 3), command[0], command[1], command[2]))
            at += duration
        return tuple(rows)

    def commands(self) -> Commands:
        """Return the commands, with the stop at the end."""
        rows = self.rows()
        front, rear = self.neutral[1:] if self.turns_on_the_spot else rows[-1][2:]
        table = np.array([*rows, (round(self.duration_s, 3), self.neutral.drive, front, rear)])
        t_s, drive, fronts, rears = (np.ascontiguousarray(column) for column in table.T)
        return Commands(t_s, drive, fronts, rears)


def levels_of(maps: NodalMaps, values: Floats) -> Levels:
    """Return levels among the nodes of the maps; `values` are the fitted nodal values."""
    where = maps.slices()
    speed = values[where["drive"]]
    drives = []
    for sign in (1.0, -1.0):
        own = np.flatnonzero(sign * speed > 0.02)
        if len(own):
            fastest = own[np.argmax(sign * speed[own])]
            half = own[np.argmin(np.abs(sign * speed[own] - 0.5 * sign * speed[fastest]))]
            drives += [float(maps.nodes["drive"][k]) for k in dict.fromkeys((fastest, half))]
    if "front" in maps.zero_at_neutral:
        nodes = np.insert(maps.nodes["front"], 0, maps.neutral.front)
        yaw_rates = _steering(nodes, np.insert(values[where["front"]], 0, 0.0), maps.neutral.front, math.inf)
        return Levels(tuple(drives), yaw_rates, (maps.neutral.rear,), maps.neutral, turns_on_the_spot=True)
    front, rear = (
        _steering(maps.nodes[role], values[where[role]], getattr(maps.neutral, role)) for role in ("front", "rear")
    )
    return Levels(tuple(drives), front, rear, maps.neutral)


def _steering(nodes: Floats, angle: Floats, neutral: float, largest: float = _MAX_ANGLE_RAD) -> tuple[float, ...]:
    """Return the straight level first, then the far and half-way levels to either side."""
    straight = int(np.argmin(np.abs(nodes - neutral)))
    bent = angle - angle[straight]
    chosen = [straight]
    for sign in (1.0, -1.0):
        own = np.flatnonzero((sign * bent > 0.03) & (np.abs(angle) < largest))
        if len(own):
            far = own[np.argmax(sign * bent[own])]
            half = own[np.argmin(np.abs(bent[own] - 0.5 * bent[far]))]
            chosen += [int(far), int(half)]
    return tuple(float(nodes[k]) for k in dict.fromkeys(chosen))


def designs(levels: Levels) -> list[Design]:
    """Return the initial designs: constant commands, steering in steps, stops and starts, forward and backward."""
    return [Design(tuple(steps), levels.neutral, levels.turns_on_the_spot) for steps in _sequences(levels) if steps]


def _sequences(levels: Levels) -> Iterator[list[Step]]:
    poses = list(_steerings(levels))
    straight = (levels.front[0], levels.rear[0])
    for drive in levels.drive:
        for steering in poses:
            for seconds in (4.0, 8.0):
                yield [(seconds, drive, *steering)]
            for rhythm in _RHYTHMS_S[:-1]:
                yield _repeated([(rhythm, drive, *steering), (rhythm, levels.neutral.drive, *steering)])
        for one, other in [*((straight, s) for s in poses[1:]), *pairwise(poses[1:])]:
            for rhythm in _RHYTHMS_S:
                yield _repeated([(rhythm, drive, *one), (rhythm, drive, *other)])
    for first, second in pairwise(levels.drive):
        for steering in poses:
            for rhythm in _RHYTHMS_S[:-1]:
                yield _repeated([(rhythm, first, *steering), (rhythm, second, *steering)])


def _steerings(levels: Levels) -> Iterator[tuple[float, float]]:
    fronts, rears = levels.front, levels.rear
    yield fronts[0], rears[0]
    for front in fronts[1:]:
        yield front, rears[0]
    for rear in rears[1:3]:
        yield fronts[0], rear
    for k in range(1, min(len(fronts), len(rears))):
        yield fronts[k], rears[k]  # crab
    if len(fronts) > 3 and len(rears) > 3:
        yield fronts[1], rears[3]  # opposite, each way
        yield fronts[3], rears[1]


def _repeated(steps: list[Step]) -> list[Step]:
    seconds = sum(step[0] for step in steps)
    return steps * max(1, min(int(MAX_DURATION_S / seconds), _MAX_STEPS // len(steps)))


def mutated(design: Design, levels: Levels, rng: np.random.Generator) -> Design:
    """Return a design with one step changed: another level or duration, or one step more or less."""
    steps = list(design.steps)
    k = int(rng.integers(len(steps)))
    duration, drive, front, rear = steps[k]
    kind = int(rng.integers(6))
    if kind == 0:
        steps[k] = (round(max(_MIN_STEP_S, duration * float(rng.choice([0.6, 0.8, 1.25, 1.6]))), 2), drive, front, rear)
    elif kind == 1:
        steps[k] = (duration, float(rng.choice([*levels.drive, levels.neutral.drive])), front, rear)
    elif kind == 2:
        steps[k] = (duration, drive, float(rng.choice(levels.front)), rear)
    elif kind == 3:
        steps[k] = (duration, drive, front, float(rng.choice(levels.rear)))
    elif kind == 4 and len(steps) < _MAX_STEPS:
        steps.insert(k, (0.6, *steps[int(rng.integers(len(steps)))][1:]))
    elif len(steps) > 1:
        del steps[k]
    made = replace(design, steps=tuple(steps))
    return made if made.duration_s <= MAX_DURATION_S + SET_FIRST_S + 0.5 else design
