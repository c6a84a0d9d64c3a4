"""Predicted poses of all runs and their derivatives, by repeated simulation of slightly different runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agvbench.diagnosis.batch import Batch
from agvbench.diagnosis.levels import ROLES
from agvbench.diagnosis.linearised import Linearised
from agvbench.types import Floats

OFFSETS = ("x_m", "y_m", "heading_rad", "front_rad", "rear_rad", "log_speed")
"""What may differ from run to run: the start pose, an offset of each axle, and a factor on speed."""

_STEP = 1e-4  # rad, m/s
_STEP_SHARE = 1e-3
_FARTHEST_RAD = 1.4


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
