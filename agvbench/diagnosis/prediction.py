"""Predicted poses of all runs and their derivatives, by repeated simulation of slightly different runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.levels import ROLES, FreeMaps
from agvbench.diagnosis.reading import Readings
from agvbench.effects import Effect
from agvbench.model.simulation import Simulation
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry

OFFSETS = ("x_m", "y_m", "heading_rad", "front_rad", "rear_rad", "log_speed")
"""What may differ from run to run: the start pose, an offset of each axle, and a factor on speed."""

_STEP = 1e-4  # rad, m/s
_STEP_SHARE = 1e-3
_FARTHEST_RAD = 1.4


@dataclass(frozen=True)
class Linearised:
    """Predicted poses and their derivatives, of which only those are kept that may differ from zero.

    ``poses`` (R, K, 3); ``own`` (R, m): the numbers of the parameters that each run depends on at most, of ``count``
    (P); ``by_own`` (R, K, 3, m): derivatives by these; ``by_offsets`` (R, K, 3, 6).
    """

    poses: Floats
    own: NDArray[np.int64]
    by_own: Floats
    by_offsets: Floats
    count: int

    @property
    def by_parameters(self) -> Floats:
        """The derivatives by all parameters (R, K, 3, P), zeros and all."""
        out = np.zeros((*self.poses.shape, self.count))
        np.put_along_axis(out, self.own[:, None, None, :], self.by_own, axis=-1)
        return out

    def with_last(self, slopes: Floats) -> Linearised:
        """Return these and derivatives (R, K, 3, q) by further parameters, which come last."""
        more = np.arange(self.count, self.count + slopes.shape[-1])
        own = np.concatenate([self.own, np.broadcast_to(more, (len(self.own), len(more)))], axis=1)
        by_own = np.concatenate([self.by_own, slopes], axis=-1)
        return replace(self, own=own, by_own=by_own, count=self.count + len(more))

    def by_first(self, count: int) -> Linearised:
        """Return these without the derivatives by the last parameters: by the maps' values alone, or by none.

        In ``own`` the effects come last, and every run depends on each.
        """
        kept = self.own.shape[1] - (self.count - count) if count else 0
        return replace(self, own=self.own[:, :kept], by_own=self.by_own[..., :kept], count=count)


class Batch:
    """Runs packed for simulation: as they are, and as lanes, each of which differs in one level or in heading.

    A run's own levels of command are varied one by one, which gives the derivatives by the maps' values and by the
    run's offsets alike. Where commands change so often that a run has more levels than free values, the values are
    varied instead (``by_node``). Packed once, it serves every set of effects, also ``kinds``
    beyond those of the library. ``level_scatter`` as for
    `Simulation.predict`; ``redundancy``: so many windows are as much evidence as one.
    """

    def __init__(
        self,
        readings: Readings,
        maps: FreeMaps,
        geometry: Geometry,
        level_scatter: float = np.inf,
        redundancy: float = 1.0,
        kinds: Sequence[type[Effect]] = (),
    ) -> None:
        self.readings, self.maps, self.geometry = readings, maps, geometry
        self.level_scatter, self.redundancy, self.kinds = level_scatter, redundancy, tuple(kinds)
        runs = readings.simulated()
        self.base = Simulation(geometry, maps.neutral, runs, kinds=kinds)
        self.commands: dict[str, Floats] = {role: getattr(self.base, role) for role in ROLES}
        self.weights = {role: maps.weights(role, self.commands[role]) for role in ROLES}
        self.drives = self.commands["drive"] != maps.neutral
        owns = [np.arange(a, b) for a, b in pairwise(self.base.row_starts.tolist())]
        self.by_node = sum(map(self._count_nodes, owns)) < sum(map(self._count_levels, owns))
        varied = [list(self._nodes(own) if self.by_node else self._levels(own)) for own in owns]
        run, kind, row, changed = [], [], [], []
        for i, own in enumerate(owns):
            still = np.zeros((len(own), len(ROLES)))
            for role, first, change in [("base", -1, still), ("heading", -1, still), *varied[i]]:
                run.append(i)
                kind.append(role)
                row.append(first)
                changed.append(change)
        # Of a lane that varies a level, `lane_row` is a row that has it; of one that varies a node, the node.
        self.lane_run, self.lane_kind, self.lane_row = np.array(run), np.array(kind), np.array(row)
        self.lanes = Simulation(geometry, maps.neutral, [runs[i] for i in run], kinds=kinds)
        self.touched = self._touched(owns)
        self.column = self._column()
        self.rows = np.concatenate([owns[i] for i in run])
        self.row_change = np.concatenate(changed)

    def _touched(self, owns: list[NDArray[np.int64]]) -> NDArray[np.int64]:
        """Return which of the maps' values each run depends on (R, m), and others where it depends on fewer than m."""
        used = np.array(
            [np.concatenate([(self.weights[role][own] != 0.0).any(axis=0) for role in ROLES]) for own in owns]
        )
        return np.argsort(~used, axis=1, kind="stable")[:, : max(1, int(used.sum(axis=1).max()))]

    def _column(self) -> NDArray[np.int64]:
        """Return in which column of `touched` each run has each of the maps' values (R, values), -1 for none."""
        column = np.full((len(self.touched), self.maps.size), -1)
        np.put_along_axis(column, self.touched, np.arange(self.touched.shape[1])[None, :], axis=1)
        return column

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


class Predictor:
    """Runs under free maps and some effects; the parameters are the maps' values, then the effects' parameters.

    A derivative is a difference between two simulations.
    """

    def __init__(self, batch: Batch, effects: tuple[str, ...] = ()) -> None:
        self.batch, self.effects = batch, effects
        self.readings, self.maps = batch.readings, batch.maps
        self._own = np.concatenate([np.empty(0, dtype=np.int64), *(batch.base.indices(name) for name in effects)])
        self.parameter_names: list[str] = [batch.base.parameter_names[i] for i in self._own]
        self.nulls: Floats = batch.base.nulls[self._own]
        self._steps = _STEP_SHARE * batch.base.scales[self._own]

    def settled(self, parameters: Floats) -> tuple[Floats, Floats]:
        """Return settled angles and speed of every row (rows, 3), and initial states (R, 5)."""
        return self._inputs(parameters, np.zeros((len(self.readings), len(OFFSETS))))

    def all_parameters(self, parameters: Floats) -> Floats:
        """Return the simulation's whole parameter vector for the predictor's own."""
        return self._all(parameters[self.maps.size :])

    def _all(self, own: Floats) -> Floats:
        values = self.batch.base.nulls.copy()
        values[self._own] = own
        return values

    def _inputs(self, parameters: Floats, offsets: Floats) -> tuple[Floats, Floats]:
        """Return settled values of every row (rows, 3) and initial states (runs, 5)."""
        where, run = self.maps.slices(), self.batch.base.row_runs
        values = [self.batch.weights[role] @ parameters[where[role]] for role in ROLES]
        front, rear = (np.clip(values[k] + offsets[run, 3 + k], -_FARTHEST_RAD, _FARTHEST_RAD) for k in (0, 1))
        speed = np.where(self.batch.drives, values[2] * np.exp(offsets[run, 5]), 0.0)
        initial = np.zeros((len(self.readings), 5))
        initial[:, :3] = self.readings.start + offsets[:, :3]
        if self.readings.begins is not None:
            initial[:, 3] = self.readings.begins.speed_mps
            initial[:, 4] = self.readings.begins.lately_mps
        return np.column_stack([front, rear, speed]), initial

    def predict(self, parameters: Floats, offsets: Floats | None = None) -> Floats:
        """Return poses (R, K, 3) for parameters (P,) and offsets (R, 6), by default none."""
        offsets = np.zeros((len(self.readings), len(OFFSETS))) if offsets is None else offsets
        settled, initial = self._inputs(parameters, offsets)
        return self._simulate(settled, parameters[self.maps.size :], initial)

    def _simulate(self, settled: Floats, own: Floats, initial: Floats) -> Floats:
        poses = self.batch.base.predict(settled, self._all(own), initial, level_scatter=self.batch.level_scatter)
        return poses.reshape(len(self.readings), -1, 3)

    def linearise(self, parameters: Floats, offsets: Floats, near: Linearised | None = None) -> Linearised:
        """Return poses and derivatives about parameters (P,) and offsets (R, 6).

        Where `near` is given, derivatives by the maps' values and by offsets are taken from there.
        """
        settled, initial = self._inputs(parameters, offsets)
        own = parameters[self.maps.size :]
        if near is None:
            by_maps = self._by_lanes(parameters, offsets, settled, initial)
        else:
            by_maps = replace(near.by_first(self.maps.size), poses=self._simulate(settled, own, initial))
        return by_maps.with_last(self._slopes(settled, own, initial, by_maps.poses, range(len(own))))

    def _by_lanes(self, parameters: Floats, offsets: Floats, settled: Floats, initial: Floats) -> Linearised:
        """Return poses and their derivatives by the maps' values and by offsets."""
        own = parameters[self.maps.size :]
        batch = self.batch
        lanes = self._simulate_lanes(settled, initial, own)
        base = lanes[batch.lane_kind == "base"]
        by_own = np.zeros((*base.shape, batch.touched.shape[1]))
        columns = by_own.transpose(0, 3, 1, 2)
        by_offsets = np.zeros((*base.shape, len(OFFSETS)))
        by_offsets[:, :, 0, 0] = by_offsets[:, :, 1, 1] = 1.0
        by_offsets[..., 2] = (lanes[batch.lane_kind == "heading"] - base) / _STEP
        where = self.maps.slices()
        for k, role in enumerate(ROLES):
            chosen = np.flatnonzero(batch.lane_kind == role)
            run, row = batch.lane_run[chosen], batch.lane_row[chosen]
            change = (lanes[chosen] - base[run]) / _STEP
            drives = role == "drive"
            if batch.by_node:
                scale = np.exp(offsets[run, 5]) if drives else np.ones(len(run))
                own_value = scale * parameters[where[role]][row] if drives else scale
                np.add.at(by_offsets[..., 3 + k], run, change * own_value[:, None, None])
                columns[run, batch.column[run, where[role].start + row]] = change * scale[:, None, None]
                continue
            factor = settled[row, 2] if drives else np.ones(len(row))
            np.add.at(by_offsets[..., 3 + k], run, change * factor[:, None, None])
            weights = batch.weights[role][row] * (np.exp(offsets[run, 5]) if drives else np.ones(len(row)))[:, None]
            for node in range(weights.shape[1]):
                used = weights[:, node] != 0.0
                own_column = batch.column[run[used], where[role].start + node]
                np.add.at(columns, (run[used], own_column), change[used] * weights[used, node][:, None, None])
        return Linearised(base, batch.touched, by_own, by_offsets, self.maps.size)

    def by_last(self, parameters: Floats, offsets: Floats, count: int) -> tuple[Floats, Floats]:
        """Return poses (R, K, 3), and their derivatives by the last `count` parameters (R, K, 3, count)."""
        settled, initial = self._inputs(parameters, offsets)
        own = parameters[self.maps.size :]
        base = self._simulate(settled, own, initial)
        last = range(len(own) - count, len(own))
        return base, self._slopes(settled, own, initial, base, last)

    def _slopes(self, settled: Floats, own: Floats, initial: Floats, base: Floats, which: range) -> Floats:
        """Return the derivatives (R, K, 3, q) of poses `base` by some of the effects' parameters."""
        slopes = np.empty((*base.shape, len(which)))
        for column, k in enumerate(which):
            moved = own.copy()
            moved[k] += self._steps[k]
            slopes[..., column] = (self._simulate(settled, moved, initial) - base) / self._steps[k]
        return slopes

    def _simulate_lanes(self, settled: Floats, initial: Floats, own: Floats) -> Floats:
        batch = self.batch
        varied = settled[batch.rows] + _STEP * batch.row_change
        first = initial[batch.lane_run]
        first[:, 2] += _STEP * (batch.lane_kind == "heading")
        return batch.lanes.predict(varied, self._all(own), first, level_scatter=batch.level_scatter).reshape(
            len(batch.lane_run), -1, 3
        )
