"""Runs packed for simulation, nominal and perturbed: finite differences between both give derivatives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.model.nodal_maps import ROLES, NodalMaps
from agvbench.diagnosis.model.repeats import Repeats
from agvbench.diagnosis.model.smoothness import SmoothnessPrior
from agvbench.effects import Effect
from agvbench.model.priors import Prior
from agvbench.model.simulation.simulation import Simulation
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class GroupedSums:
    """Grouping of n terms into u sums.

    ``order`` (n,): indices of the terms in the order of addition; ``first`` (u,): position of each sum's first term in
    that order; ``key`` (u, q): the key of each sum.
    """

    order: Integers
    first: Integers
    key: Integers

    @classmethod
    def of(cls, *key: Integers) -> GroupedSums:
        """Return the grouping of terms by their keys, q arrays (n,); terms of a sum keep their order."""
        order = np.lexsort(key[::-1])
        ordered = np.column_stack(key)[order]
        first = np.flatnonzero(np.any(np.diff(ordered, axis=0, prepend=-1) != 0, axis=1))
        return cls(order, first, ordered[first])

    def sums(self, terms: Floats) -> Floats:
        """Return the sums (u, …) of terms (n, …)."""
        ordered = terms[self.order]
        return ordered if len(self.first) == len(ordered) else np.add.reduceat(ordered, self.first, axis=0)


@dataclass(frozen=True)
class PerturbationBatch:
    """The n perturbations of one command: each changes one level (or one nodal value) in one run.

    ``index`` (n,): position among all perturbations; ``run`` (n,): the perturbed run; ``row`` (n,): a row with that
    level, or the index of the nodal value. ``term`` (t,) and ``weight`` (t,): index and weight of the perturbation in
    each term of a derivative by a nodal value. ``by_run`` groups perturbations by run. ``by_value`` groups terms by run
    and column.
    """

    index: Integers
    run: Integers
    row: Integers
    term: Integers
    weight: Floats
    by_run: GroupedSums
    by_value: GroupedSums

    @classmethod
    def of(cls, index: Integers, run: Integers, row: Integers, weights: Floats, column: Integers) -> PerturbationBatch:
        """Return perturbations with `weights` (n, values) in the columns (runs, values) of the derivatives."""
        term, value = np.nonzero(weights)
        by_value = GroupedSums.of(run[term], column[run[term], value])
        return cls(index, run, row, term, weights[term, value], GroupedSums.of(run), by_value)


class Batch:
    """Runs packed for simulation, with a perturbation batch: copies of runs that differ in one level or in heading.

    Each command level of a run is perturbed by itself. This gives the derivatives by the nodal values and by the run's
    random effects. If the runs have more command levels than nodal values, the nodal values are perturbed instead
    (``by_node``). One batch serves every set of effects, including ``kinds`` outside the library.
    ``smoothness`` is the prior of the nodal values. ``nodal_deviation`` is that of `Simulation.predict`.
    ``autocorrelation_time`` is the number of windows that are worth one independent window. ``has_heavy_tails`` is
    whether the errors of runs have Student's t distribution; those of windows always do.
    """

    has_heavy_tails: bool = False

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
        self.smoothness = SmoothnessPrior.of(maps, readings)
        self.repeats = Repeats.of(readings)
        self._alike: tuple[Floats, Repeats] = np.empty(0), self.repeats
        runs = readings.simulated()
        self.base = Simulation(geometry, maps.neutral, runs, kinds=kinds)
        self.commands: dict[str, Floats] = {role: getattr(self.base, role) for role in ROLES}
        self.weights = {role: maps.weights(role, self.commands[role]) for role in ROLES}
        self.acting = self._acting()
        rows_of_run = [np.arange(a, b) for a, b in pairwise(self.base.row_starts.tolist())]
        self.by_node = sum(map(self._count_nodes, rows_of_run)) < sum(map(self._count_levels, rows_of_run))
        changes = [list(self._nodes(own) if self.by_node else self._levels(own)) for own in rows_of_run]
        run, kind, row, changed = [], [], [], []
        for i, own in enumerate(rows_of_run):
            unchanged = np.zeros((len(own), len(ROLES)))
            for role, first, change in [("heading", -1, unchanged), *changes[i]]:
                run.append(i)
                kind.append(role)
                row.append(first)
                changed.append(change)
        self.perturbed_run = np.array(run)
        self.perturbations = Simulation(geometry, maps.neutral, [runs[i] for i in run], kinds=kinds)
        self.active = self._active(rows_of_run)
        self.heading_perturbed = np.array(kind) == "heading"
        self.perturbed = self._grouped(np.array(kind), np.array(row))
        self.rows = np.concatenate([rows_of_run[i] for i in run])
        self.row_change = np.concatenate(changed)

    def alike(self, poses: Floats, heading: Floats) -> Repeats:
        """Return the repeats whose `poses` (R, K, 3), predicted from a `heading` (R,), are alike; the last are kept."""
        if self._alike[0] is not poses:
            self._alike = poses, self.repeats.among_alike(poses, heading)
        return self._alike[1]

    def perturbations_of(self, repeats: Repeats) -> Integers:
        """Return the perturbation (n,) of each run's representative; those of repeats are in the same order."""
        begins = np.searchsorted(self.perturbed_run, np.arange(len(self.readings)))
        behind = np.arange(len(self.perturbed_run)) - begins[self.perturbed_run]
        return np.asarray(begins[repeats.representative[self.perturbed_run]] + behind)

    def _acting(self) -> dict[str, NDArray[np.bool_]]:
        """Return the rows (rows,) in which each channel acts: the drive unless it is at neutral, the steering always.

        The yaw rate of a differential vehicle acts while the vehicle is commanded to move.
        """
        driven = self.commands["drive"] != self.maps.neutral.drive
        always = np.ones(len(driven), dtype=np.bool_)
        turns = driven | (self.commands["front"] != self.maps.neutral.front)
        return {"drive": driven, "front": turns if self.geometry.is_differential else always, "rear": always}

    def repacked(self, *, kinds: Sequence[type[Effect]] | None = None, preset: bool | None = None) -> Batch:
        """Return this batch with other effects outside the library, or another hypothesis on the initial steering.

        `preset` is that of `Readings`. What is not given stays as it is.
        """
        readings = self.readings if preset is None else replace(self.readings, preset=preset)
        kinds, level = self.kinds if kinds is None else kinds, self.nodal_deviation
        return Batch(readings, self.maps, self.geometry, level, self.autocorrelation_time, kinds)

    def with_priors(self, priors: tuple[Prior, ...]) -> Batch:
        """Return this batch with other priors of the effects' parameters; both share the packed runs."""
        other = copy(self)
        other.readings = replace(self.readings, priors=priors)
        return other

    def with_heavy_tails(self) -> Batch:
        """Return this batch with heavy tails; both share the packed runs."""
        other = copy(self)
        other.has_heavy_tails = True
        return other

    def _active(self, rows_of_run: list[NDArray[np.int64]]) -> NDArray[np.int64]:
        """Return the indices of each run's active nodal values (R, m), padded with inactive ones."""
        used = np.array(
            [np.concatenate([(self.weights[role][own] != 0.0).any(axis=0) for role in ROLES]) for own in rows_of_run]
        )
        return np.argsort(~used, axis=1, kind="stable")[:, : max(1, int(used.sum(axis=1).max()))]

    def _grouped(self, kind: NDArray[np.str_], row: NDArray[np.int64]) -> dict[str, PerturbationBatch]:
        """Return the perturbations by role; `kind` (n,) is their role, `row` (n,) a row with the level or the node."""
        # The column of `active` for each nodal value of each run.
        column = np.full((len(self.active), self.maps.size), -1)
        np.put_along_axis(column, self.active, np.arange(self.active.shape[1])[None, :], axis=1)
        grouped = {}
        for role, own in self.maps.slices().items():
            index = np.flatnonzero(kind == role)
            values = np.eye(len(self.maps.nodes[role])) if self.by_node else self.weights[role]
            grouped[role] = PerturbationBatch.of(
                index, self.perturbed_run[index], row[index], values[row[index]], column[:, own]
            )
        return grouped

    def _count_levels(self, own: NDArray[np.int64]) -> int:
        return sum(len(np.unique(self.commands[r][own][self.acting[r][own]])) for r in ROLES)

    def _count_nodes(self, own: NDArray[np.int64]) -> int:
        return sum(int(np.count_nonzero(self.weights[r][own][self.acting[r][own]].any(axis=0))) for r in ROLES)

    def _levels(self, own: NDArray[np.int64]) -> Iterator[tuple[str, int, Floats]]:
        """Yield role, a row with it, and the derivative of each row's commands (rows, 3) for each level of one run."""
        for k, role in enumerate(ROLES):
            rows = self.acting[role][own]
            values = self.commands[role][own]
            for level in np.unique(values[rows]):
                moves = rows & (values == level)
                yield role, int(own[np.argmax(moves)]), np.outer(moves, np.arange(len(ROLES)) == k).astype(np.float64)

    def _nodes(self, own: NDArray[np.int64]) -> Iterator[tuple[str, int, Floats]]:
        """Yield role, index, and the derivative of each row's commands (rows, 3) for each nodal value of one run."""
        for k, role in enumerate(ROLES):
            weights = self.weights[role][own] * self.acting[role][own][:, None]
            for node in np.flatnonzero(weights.any(axis=0)):
                yield role, int(node), np.outer(weights[:, node], np.arange(len(ROLES)) == k)
