"""Predicted poses of all runs and their derivatives, by repeated simulation of slightly different runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.levels import ROLES, FreeMaps
from agvbench.diagnosis.reading import Readings
from agvbench.model.simulation import SimulatedRun, Simulation
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry

OFFSETS = ("x_m", "y_m", "heading_rad", "front_rad", "rear_rad", "log_speed")
"""What may differ from run to run: the start pose, an offset of each axle, and a factor on speed."""

_STEP = 1e-4  # rad, m/s
_STEP_SHARE = 1e-3
_FARTHEST_RAD = 1.4


@dataclass(frozen=True)
class Linearised:
    """Predicted ``poses`` (R, K, 3), derivatives ``by_parameters`` (R, K, 3, P) and ``by_offsets`` (R, K, 3, 6)."""

    poses: Floats
    by_parameters: Floats
    by_offsets: Floats


class Batch:
    """Runs packed for simulation: as they are, and as lanes, each of which differs in one level or in heading.

    A run's own levels of command are varied one by one, which gives the derivatives by the maps' values and by the
    run's offsets alike. Packed once, it serves every set of effects.
    """

    def __init__(self, readings: Readings, maps: FreeMaps, geometry: Geometry) -> None:
        self.readings, self.maps, self.geometry = readings, maps, geometry
        runs = [
            SimulatedRun(run.commands, t, float(h))
            for run, t, h in zip(readings.runs, readings.t_s, readings.started_h, strict=True)
        ]
        self.base = Simulation(geometry, maps.neutral, runs)
        self.commands: dict[str, Floats] = {role: getattr(self.base, role) for role in ROLES}
        self.weights = {role: maps.weights(role, self.commands[role]) for role in ROLES}
        self.drives = self.commands["drive"] != maps.neutral
        run, kind, row, moved = [], [], [], []
        for i in range(len(runs)):
            own = np.arange(self.base.row_starts[i], self.base.row_starts[i + 1])
            for role, moves in [("base", own[:0]), ("heading", own[:0]), *self._levels(own)]:
                run.append(i)
                kind.append(role)
                row.append(int(moves[0]) if len(moves) else -1)
                moved.append(np.isin(own, moves))
        self.lane_run, self.lane_kind, self.lane_row = np.array(run), np.array(kind), np.array(row)
        self.lanes = Simulation(geometry, maps.neutral, [runs[i] for i in run])
        starts = self.base.row_starts
        self.rows = np.concatenate([np.arange(starts[i], starts[i + 1]) for i in run])
        self.row_kind = np.where(np.concatenate(moved), self.lane_kind[self.lanes.row_runs], "")

    def _levels(self, own: NDArray[np.int64]) -> Iterator[tuple[str, NDArray[np.int64]]]:
        """Yield each level of each command of one run with the rows that have it."""
        for role in ROLES:
            rows = own[self.drives[own]] if role == "drive" else own
            values = self.commands[role][rows]
            for level in np.unique(values):
                yield role, rows[values == level]


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

    def _all(self, own: Floats) -> Floats:
        values = self.batch.base.nulls.copy()
        values[self._own] = own
        return values

    def _inputs(self, parameters: Floats, offsets: Floats) -> tuple[Floats, Floats]:
        """Return settled values of every row (rows, 3) and initial states (runs, 4)."""
        where, run = self.maps.slices(), self.batch.base.row_runs
        values = [self.batch.weights[role] @ parameters[where[role]] for role in ROLES]
        front, rear = (np.clip(values[k] + offsets[run, 3 + k], -_FARTHEST_RAD, _FARTHEST_RAD) for k in (0, 1))
        speed = np.where(self.batch.drives, values[2] * np.exp(offsets[run, 5]), 0.0)
        initial = np.zeros((len(self.readings), 4))
        initial[:, :3] = self.readings.start + offsets[:, :3]
        return np.column_stack([front, rear, speed]), initial

    def predict(self, parameters: Floats, offsets: Floats | None = None) -> Floats:
        """Return poses (R, K, 3) for parameters (P,) and offsets (R, 6), by default none."""
        offsets = np.zeros((len(self.readings), len(OFFSETS))) if offsets is None else offsets
        settled, initial = self._inputs(parameters, offsets)
        return self._simulate(settled, parameters[self.maps.size :], initial)

    def _simulate(self, settled: Floats, own: Floats, initial: Floats) -> Floats:
        poses = self.batch.base.predict(settled, self._all(own), initial)
        return poses.reshape(len(self.readings), -1, 3)

    def linearise(self, parameters: Floats, offsets: Floats) -> Linearised:
        """Return poses and derivatives about parameters (P,) and offsets (R, 6)."""
        settled, initial = self._inputs(parameters, offsets)
        own = parameters[self.maps.size :]
        batch = self.batch
        lanes = self._simulate_lanes(settled, initial, own)
        base = lanes[batch.lane_kind == "base"]
        by_parameters = np.zeros((*base.shape, len(parameters)))
        by_offsets = np.zeros((*base.shape, len(OFFSETS)))
        by_offsets[:, :, 0, 0] = by_offsets[:, :, 1, 1] = 1.0
        by_offsets[..., 2] = (lanes[batch.lane_kind == "heading"] - base) / _STEP
        where = self.maps.slices()
        for k, role in enumerate(ROLES):
            chosen = np.flatnonzero(batch.lane_kind == role)
            run, row = batch.lane_run[chosen], batch.lane_row[chosen]
            change = (lanes[chosen] - base[run]) / _STEP
            drives = role == "drive"
            factor = settled[row, 2] if drives else np.ones(len(row))
            np.add.at(by_offsets[..., 3 + k], run, change * factor[:, None, None])
            weights = batch.weights[role][row] * (np.exp(offsets[run, 5]) if drives else np.ones(len(row)))[:, None]
            target = by_parameters[..., where[role]]
            for node in range(weights.shape[1]):
                used = weights[:, node] != 0.0
                np.add.at(target[..., node], run[used], change[used] * weights[used, node][:, None, None])
        for k in range(len(own)):
            by_parameters[..., self.maps.size + k] = self._slope(settled, own, initial, base, k)
        return Linearised(base, by_parameters, by_offsets)

    def by_last(self, parameters: Floats, offsets: Floats, count: int) -> tuple[Floats, Floats]:
        """Return poses (R, K, 3), and their derivatives by the last `count` parameters (R, K, 3, count)."""
        settled, initial = self._inputs(parameters, offsets)
        own = parameters[self.maps.size :]
        base = self._simulate(settled, own, initial)
        last = range(len(own) - count, len(own))
        return base, np.stack([self._slope(settled, own, initial, base, k) for k in last], axis=-1)

    def _slope(self, settled: Floats, own: Floats, initial: Floats, base: Floats, k: int) -> Floats:
        moved = own.copy()
        moved[k] += self._steps[k]
        return np.asarray((self._simulate(settled, moved, initial) - base) / self._steps[k])

    def _simulate_lanes(self, settled: Floats, initial: Floats, own: Floats) -> Floats:
        batch = self.batch
        varied = settled[batch.rows] + _STEP * (batch.row_kind[:, None] == np.array(ROLES))
        first = initial[batch.lane_run]
        first[:, 2] += _STEP * (batch.lane_kind == "heading")
        return batch.lanes.predict(varied, self._all(own), first).reshape(len(batch.lane_run), -1, 3)
