"""Runs packed for simulation, with slightly different variants of them whose differences are derivatives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.model.nodal_maps import ROLES, NodalMaps
from agvbench.effects import Effect
from agvbench.model.simulation.simulation import Simulation
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class GroupedSums:
    """Which of n terms add up to each of u sums.

    ``order`` (n,): the terms as they are added; ``first`` (u,): where each sum begins in that order; ``place`` (u, q):
    the numbers that stand for each sum.
    """

    order: Integers
    first: Integers
    place: Integers

    @classmethod
    def of(cls, *place: Integers) -> GroupedSums:
        """Return what gathers terms by their numbers, q arrays (n,); within a sum they keep their order."""
        order = np.lexsort(place[::-1])
        ordered = np.column_stack(place)[order]
        first = np.flatnonzero(np.any(np.diff(ordered, axis=0, prepend=-1) != 0, axis=1))
        return cls(order, first, ordered[first])

    def sums(self, terms: Floats) -> Floats:
        """Return the sums (u, …) of terms (n, …)."""
        ordered = terms[self.order]
        return ordered if len(self.first) == len(ordered) else np.add.reduceat(ordered, self.first, axis=0)


@dataclass(frozen=True)
class PerturbationBatch:
    """The variants of runs in which one level (or one free value) of one command is changed, n of them.

    ``number`` (n,): which perturbations these are; ``run`` (n,): of which run; ``row`` (n,): a row that has the level,
    or the number of the value. ``term`` (t,) and ``weight`` (t,): which change counts how much for each derivative by a
    free value. ``by_run`` sums perturbations, ``by_value`` terms by run and column.
    """

    number: Integers
    run: Integers
    row: Integers
    term: Integers
    weight: Floats
    by_run: GroupedSums
    by_value: GroupedSums

    @classmethod
    def of(cls, number: Integers, run: Integers, row: Integers, weights: Floats, column: Integers) -> PerturbationBatch:
        """Return perturbations that count by `weights` (n, values) in the columns (runs, values) of their runs."""
        term, value = np.nonzero(weights)
        by_value = GroupedSums.of(run[term], column[run[term], value])
        return cls(number, run, row, term, weights[term, value], GroupedSums.of(run), by_value)


class Batch:
    """Runs packed for simulation: as they are, and perturbed, each time in one level or in heading.

    A run's own levels of command are varied one by one, which gives the derivatives by the maps' values and by the
    run's offsets alike. Where commands change so often that a run has more levels than free values, the values are
    varied instead (``by_node``). Packed once, it serves every set of effects, also ``kinds``
    beyond those of the library. ``nodal_deviation`` as for
    `Simulation.predict`; ``autocorrelation_time``: so many windows are as much evidence as one.
    """

    def __init__(
        self,
        readings: Readings,
        maps: NodalMaps,
        geometry: Geometry,
        nodal_deviation: float = np.inf,
        autocorrelation_time: float = 1.0,
        kinds: Sequence[type[Effect]] = (),
    ) -> None:
        self.readings, self.maps, self.geometry = readings, maps, geometry
        self.nodal_deviation, self.autocorrelation_time, self.kinds = (
            nodal_deviation,
            autocorrelation_time,
            tuple(kinds),
        )
        runs = readings.simulated()
        self.base = Simulation(geometry, maps.neutral, runs, kinds=kinds)
        self.commands: dict[str, Floats] = {role: getattr(self.base, role) for role in ROLES}
        self.weights = {role: maps.weights(role, self.commands[role]) for role in ROLES}
        self.drives = self.commands["drive"] != maps.neutral
        owns = [np.arange(a, b) for a, b in pairwise(self.base.row_starts.tolist())]
        self.by_node = sum(map(self._count_nodes, owns)) < sum(map(self._count_levels, owns))
        changes = [list(self._nodes(own) if self.by_node else self._levels(own)) for own in owns]
        run, kind, row, changed = [], [], [], []
        for i, own in enumerate(owns):
            still = np.zeros((len(own), len(ROLES)))
            for role, first, change in [("heading", -1, still), *changes[i]]:
                run.append(i)
                kind.append(role)
                row.append(first)
                changed.append(change)
        self.perturbation_run = np.array(run)
        self.perturbations = Simulation(geometry, maps.neutral, [runs[i] for i in run], kinds=kinds)
        self.touched = self._touched(owns)
        self.turned = np.array(kind) == "heading"
        self.varied = self._varied(np.array(kind), np.array(row))
        self.rows = np.concatenate([owns[i] for i in run])
        self.row_change = np.concatenate(changed)

    def _touched(self, owns: list[NDArray[np.int64]]) -> NDArray[np.int64]:
        """Return which of the maps' values each run depends on (R, m), and others where it depends on fewer than m."""
        used = np.array(
            [np.concatenate([(self.weights[role][own] != 0.0).any(axis=0) for role in ROLES]) for own in owns]
        )
        return np.argsort(~used, axis=1, kind="stable")[:, : max(1, int(used.sum(axis=1).max()))]

    def _varied(self, kind: NDArray[np.str_], row: NDArray[np.int64]) -> dict[str, PerturbationBatch]:
        """Return by role the perturbations of that `kind` (n,): each varies a level of row `row`, or the node `row`."""
        # In which column of `touched` each run has each of the values.
        column = np.full((len(self.touched), self.maps.size), -1)
        np.put_along_axis(column, self.touched, np.arange(self.touched.shape[1])[None, :], axis=1)
        varied = {}
        for role, own in self.maps.slices().items():
            number = np.flatnonzero(kind == role)
            values = np.eye(len(self.maps.nodes[role])) if self.by_node else self.weights[role]
            varied[role] = PerturbationBatch.of(
                number, self.perturbation_run[number], row[number], values[row[number]], column[:, own]
            )
        return varied

    def _count_levels(self, own: NDArray[np.int64]) -> int:
        drives = self.drives[own]
        return sum(
            len(np.unique(self.commands[r][own][drives] if r == "drive" else self.commands[r][own])) for r in ROLES
        )

    def _count_nodes(self, own: NDArray[np.int64]) -> int:
        drives = self.drives[own]
        return sum(
            int(np.count_nonzero((self.weights[r][own][drives] if r == "drive" else self.weights[r][own]).any(axis=0)))
            for r in ROLES
        )

    def _levels(self, own: NDArray[np.int64]) -> Iterator[tuple[str, int, Floats]]:
        """Yield each level of each command of one run: a row that has it, and by how much each row changes with it."""
        for k, role in enumerate(ROLES):
            rows = self.drives[own] if role == "drive" else np.ones(len(own), dtype=np.bool_)
            values = self.commands[role][own]
            for level in np.unique(values[rows]):
                moves = rows & (values == level)
                yield role, int(own[np.argmax(moves)]), np.outer(moves, np.arange(len(ROLES)) == k).astype(np.float64)

    def _nodes(self, own: NDArray[np.int64]) -> Iterator[tuple[str, int, Floats]]:
        """Yield each free value that one run depends on: its number, and by how much each row changes with it."""
        for k, role in enumerate(ROLES):
            weights = self.weights[role][own] * (self.drives[own][:, None] if role == "drive" else 1.0)
            for node in np.flatnonzero(weights.any(axis=0)):
                yield role, int(node), np.outer(weights[:, node], np.arange(len(ROLES)) == k)
