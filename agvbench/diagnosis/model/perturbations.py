"""Perturbed copies of runs: finite differences to the nominal ones give derivatives."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.model.nodal_maps import ROLES, NodalMaps
from agvbench.model.simulation.simulation import SimulatedRun, Simulation
from agvbench.types import Floats

# Multiples of it modulo one are evenly spread and all different.
_GOLDEN = 0.5 * (5.0**0.5 - 1.0)

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


@dataclass(frozen=True)
class Perturbations:
    """Copies of runs, n in all, that differ in one level or in heading.

    Each command level of a run is perturbed by itself. This gives the derivatives by the nodal values and by the run's
    random effects. If the runs have more command levels than nodal values, the nodal values are perturbed instead
    (``by_node``). ``run`` (n,): index of the run. ``simulation``: the copies. ``active`` (R, m): indices of the nodal
    values that each of the R runs depends on, padded with others. ``heading`` (n,): whether the heading is perturbed.
    ``by_role``: the perturbations of each command. ``rows`` (r,) and ``row_change`` (r, 3): the row of each row of the
    copies, and the derivative of its commands. ``past`` (n,): whether only commands that ended before the window begins
    are perturbed; ``past_change`` (rows, 3): the derivative of the commands of `base` by all of these at once, which
    are of different sizes.
    """

    by_node: bool
    run: Integers
    simulation: Simulation
    active: Integers
    heading: NDArray[np.bool_]
    by_role: Mapping[str, PerturbationBatch]
    rows: Integers
    row_change: Floats
    past: NDArray[np.bool_]
    past_change: Floats

    @classmethod
    def of(
        cls,
        base: Simulation,
        runs: Sequence[SimulatedRun],
        maps: NodalMaps,
        acting: Mapping[str, NDArray[np.bool_]],
        weights: Mapping[str, Floats],
    ) -> Perturbations:
        """Return the perturbations of `runs`, which `base` simulates.

        ``acting`` and ``weights`` are those of the rows in `Batch`.
        """
        levels = _Levels(base, acting, weights)
        rows_of_run = [np.arange(a, b) for a, b in pairwise(base.row_starts.tolist())]
        by_node = sum(map(levels.count_nodes, rows_of_run)) < sum(map(levels.count, rows_of_run))
        run, kind, row, changed = [], [], [], []
        for i, own in enumerate(rows_of_run):
            unchanged = np.zeros((len(own), len(ROLES)))
            changes = levels.nodes(own) if by_node else levels.each(own)
            for role, first, change in [("heading", -1, unchanged), *changes]:
                run.append(i)
                kind.append(role)
                row.append(first)
                changed.append(change)
        kinds, index = np.array(kind), np.array(run)
        active = _active(rows_of_run, weights)
        rows, row_change = np.concatenate([rows_of_run[i] for i in run]), np.concatenate(changed)
        past = _past(base, index, rows, row_change) & (kinds != "heading")
        # Of different sizes: a common change of all speeds would leave the error of a motion filter as it is.
        size = np.repeat(past * (1.0 + _GOLDEN * np.arange(len(run)) % 1.0), [len(rows_of_run[i]) for i in run])
        past_change = np.zeros((len(base.row_runs), len(ROLES)))
        np.add.at(past_change, rows, size[:, None] * row_change)
        return cls(
            by_node,
            index,
            Simulation(base.geometry, maps.neutral, [runs[i] for i in run], kinds=base.further_kinds),
            active,
            kinds == "heading",
            _grouped(maps, weights, active, index, kinds, np.array(row), by_node=by_node),
            rows,
            row_change,
            past,
            past_change,
        )


def _active(rows_of_run: Sequence[Integers], weights: Mapping[str, Floats]) -> Integers:
    """Return the indices of each run's active nodal values (R, m), padded with inactive ones."""
    used = np.array(
        [np.concatenate([(weights[role][own] != 0.0).any(axis=0) for role in ROLES]) for own in rows_of_run]
    )
    return np.argsort(~used, axis=1, kind="stable")[:, : max(1, int(used.sum(axis=1).max()))]


def _past(base: Simulation, run: Integers, rows: Integers, row_change: Floats) -> NDArray[np.bool_]:
    """Return which copies (n,) of each `run` change commands before a window only; `rows` (r,) are those of all."""
    ends_s = np.append(base.command_t_s[1:], np.inf)
    ends_s[base.row_starts[1:] - 1] = np.inf
    changed_until_s = np.where(row_change.any(axis=1), ends_s[rows], -np.inf)
    first = np.concatenate([[0], np.cumsum(np.diff(base.row_starts)[run])[:-1]])
    return np.asarray(np.maximum.reduceat(changed_until_s, first) <= base.begins_s[run])


def _grouped(
    maps: NodalMaps,
    weights: Mapping[str, Floats],
    active: Integers,
    run: Integers,
    kind: NDArray[np.str_],
    row: Integers,
    *,
    by_node: bool,
) -> dict[str, PerturbationBatch]:
    """Return the perturbations by role; `kind` (n,) is their role, `row` (n,) a row with the level or the node."""
    # The column of `active` for each nodal value of each run.
    column = np.full((len(active), maps.size), -1)
    np.put_along_axis(column, active, np.arange(active.shape[1])[None, :], axis=1)
    grouped = {}
    for role, own in maps.slices().items():
        index = np.flatnonzero(kind == role)
        values = np.eye(len(maps.nodes[role])) if by_node else weights[role]
        grouped[role] = PerturbationBatch.of(index, run[index], row[index], values[row[index]], column[:, own])
    return grouped


@dataclass(frozen=True)
class _Levels:
    """The command levels and nodal values of the rows of runs."""

    base: Simulation
    acting: Mapping[str, NDArray[np.bool_]]
    weights: Mapping[str, Floats]

    def count(self, own: Integers) -> int:
        """Return the number of command levels of a run with the rows `own`."""
        return sum(len(np.unique(getattr(self.base, r)[own][self.acting[r][own]])) for r in ROLES)

    def count_nodes(self, own: Integers) -> int:
        """Return the number of nodal values that a run depends on."""
        return sum(int(np.count_nonzero(self.weights[r][own][self.acting[r][own]].any(axis=0))) for r in ROLES)

    def each(self, own: Integers) -> Iterator[tuple[str, int, Floats]]:
        """Yield role, a row with it, and the derivative of each row's commands (rows, 3) for each level of one run."""
        for k, role in enumerate(ROLES):
            rows = self.acting[role][own]
            values = getattr(self.base, role)[own]
            for level in np.unique(values[rows]):
                moves = rows & (values == level)
                yield role, int(own[np.argmax(moves)]), np.outer(moves, np.arange(len(ROLES)) == k).astype(np.float64)

    def nodes(self, own: Integers) -> Iterator[tuple[str, int, Floats]]:
        """Yield role, index, and the derivative of each row's commands (rows, 3) for each nodal value of one run."""
        for k, role in enumerate(ROLES):
            weights = self.weights[role][own] * self.acting[role][own][:, None]
            for node in np.flatnonzero(weights.any(axis=0)):
                yield role, int(node), np.outer(weights[:, node], np.arange(len(ROLES)) == k)
