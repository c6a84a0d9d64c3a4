"""Predicted poses of all runs and their derivatives, by simulation of slightly different runs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.nodal_maps import ROLES
from agvbench.types import Floats


@dataclass(frozen=True)
class Linearised:
    """Predicted poses and their derivatives, of which only those are kept that may differ from zero.

    ``poses`` (R, K, 3); ``own`` (R, m): the numbers of the parameters that each run depends on at most, of ``count``
    (P); ``by_own`` (R, K, 3, m): derivatives by these; ``by_random_effects`` (R, K, 3, 6).
    """

    poses: Floats
    own: NDArray[np.int64]
    by_own: Floats
    by_random_effects: Floats
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


RANDOM_EFFECTS = ("x_m", "y_m", "heading_rad", "front_rad", "rear_rad", "log_speed")
"""What may differ from run to run: the start pose, an offset of each axle, and a factor on speed."""

_STEP = 1e-4  # rad, m/s
_STEP_SHARE = 1e-3
_FARTHEST_RAD = 1.4


class Predictor:
    """Runs under nodal maps and some effects; the parameters are the maps' values, then the effects' parameters.

    A derivative is a difference between two simulations.
    """

    def __init__(self, batch: Batch, effects: tuple[str, ...] = ()) -> None:
        self.batch, self.effects = batch, effects
        self.readings, self.maps = batch.readings, batch.maps
        self._own = np.concatenate([np.empty(0, dtype=np.int64), *(batch.base.indices(name) for name in effects)])
        self.parameter_names: list[str] = [batch.base.parameter_names[i] for i in self._own]
        self.nulls: Floats = batch.base.nulls[self._own]
        self._steps = _STEP_SHARE * batch.base.scales[self._own]
        self._last: tuple[tuple[bytes, ...], Floats] = (), np.empty(0)

    def settled(self, parameters: Floats) -> tuple[Floats, Floats]:
        """Return settled angles and speed of every row (rows, 3), and initial states (R, 5)."""
        return self._inputs(parameters, np.zeros((len(self.readings), len(RANDOM_EFFECTS))))

    def all_parameters(self, parameters: Floats) -> Floats:
        """Return the simulation's whole parameter vector for the predictor's own."""
        return self._all(parameters[self.maps.size :])

    def _all(self, own: Floats) -> Floats:
        values = self.batch.base.nulls.copy()
        values[self._own] = own
        return values

    def _inputs(self, parameters: Floats, random_effects: Floats) -> tuple[Floats, Floats]:
        """Return settled values of every row (rows, 3) and initial states (runs, 5)."""
        where, run = self.maps.slices(), self.batch.base.row_runs
        values = [self.batch.weights[role] @ parameters[where[role]] for role in ROLES]
        front, rear = (np.clip(values[k] + random_effects[run, 3 + k], -_FARTHEST_RAD, _FARTHEST_RAD) for k in (0, 1))
        speed = np.where(self.batch.drives, values[2] * np.exp(random_effects[run, 5]), 0.0)
        initial = np.zeros((len(self.readings), 5))
        initial[:, :3] = self.readings.start + random_effects[:, :3]
        if self.readings.initial_states is not None:
            initial[:, 3] = self.readings.initial_states.speed_mps
            initial[:, 4] = self.readings.initial_states.recent_speed_mps
        return np.column_stack([front, rear, speed]), initial

    def predict(self, parameters: Floats, random_effects: Floats | None = None) -> Floats:
        """Return poses (R, K, 3) for parameters (P,) and offsets (R, 6), by default none.

        Those of the last time are kept, and so not to be written to: a fit looks around where it has just stepped.
        """
        random_effects = (
            np.zeros((len(self.readings), len(RANDOM_EFFECTS))) if random_effects is None else random_effects
        )
        context = (parameters.tobytes(), random_effects.tobytes())
        if context != self._last[0]:
            settled, initial = self._inputs(parameters, random_effects)
            poses = self._simulate(settled, parameters[self.maps.size :], initial)
            poses.flags.writeable = False
            self._last = context, poses
        return self._last[1]

    def _simulate(self, settled: Floats, own: Floats, initial: Floats) -> Floats:
        poses = self.batch.base.predict(settled, self._all(own), initial, nodal_deviation=self.batch.nodal_deviation)
        return poses.reshape(len(self.readings), -1, 3)

    def linearise(self, parameters: Floats, random_effects: Floats, near: Linearised | None = None) -> Linearised:
        """Return poses and derivatives about parameters (P,) and offsets (R, 6).

        Where `near` is given, derivatives by the maps' values and by offsets are taken from there.
        """
        base, inputs = self.predict(parameters, random_effects), self._inputs(parameters, random_effects)
        if near is None:
            by_maps = self._by_perturbations(parameters, random_effects, base, *inputs)
        else:
            by_maps = replace(near.by_first(self.maps.size), poses=base)
        return by_maps.with_last(self._slopes(parameters, base, *inputs, len(parameters) - self.maps.size))

    def _by_perturbations(
        self, parameters: Floats, random_effects: Floats, base: Floats, settled: Floats, initial: Floats
    ) -> Linearised:
        """Return poses `base` with their derivatives by the maps' values and by offsets."""
        batch = self.batch
        perturbations = self._simulate_perturbed(settled, initial, parameters[self.maps.size :])
        by_own = np.zeros((*base.shape, batch.touched.shape[1]))
        columns = by_own.transpose(0, 3, 1, 2)
        by_random_effects = np.zeros((*base.shape, len(RANDOM_EFFECTS)))
        by_random_effects[:, :, 0, 0] = by_random_effects[:, :, 1, 1] = 1.0
        by_random_effects[..., 2] = (perturbations[batch.turned] - base) / _STEP
        for k, role in enumerate(ROLES):
            varied = batch.varied[role]
            change = (perturbations[varied.number] - base[varied.run]) / _STEP
            by_offset, by_level = self._shares(role, parameters, random_effects, settled)
            gathered = varied.by_run
            by_random_effects[gathered.place[:, 0], :, :, 3 + k] = gathered.sums(change * by_offset[:, None, None])
            weight = varied.weight * by_level[varied.term]
            run, column = varied.by_value.place.T
            columns[run, column] = varied.by_value.sums(change[varied.term] * weight[:, None, None])
        return Linearised(base, batch.touched, by_own, by_random_effects, self.maps.size)

    def _shares(self, role: str, parameters: Floats, random_effects: Floats, settled: Floats) -> tuple[Floats, Floats]:
        """Return how much each perturbation of `role` changes (n,) with its run's offset, and with its own level."""
        varied = self.batch.varied[role]
        if role != "drive":
            return np.ones(len(varied.run)), np.ones(len(varied.run))
        faster = np.exp(random_effects[varied.run, 5])
        if self.batch.by_node:
            return faster * parameters[self.maps.slices()[role]][varied.row], faster
        return settled[varied.row, 2], faster

    def by_last(self, parameters: Floats, random_effects: Floats, count: int) -> tuple[Floats, Floats]:
        """Return poses (R, K, 3), and their derivatives by the last `count` parameters (R, K, 3, count)."""
        base = self.predict(parameters, random_effects)
        return base, self._slopes(parameters, base, *self._inputs(parameters, random_effects), count)

    def _slopes(self, parameters: Floats, base: Floats, settled: Floats, initial: Floats, count: int) -> Floats:
        """Return the derivatives (R, K, 3, count) of poses `base` by the last of the effects' parameters."""
        own = parameters[self.maps.size :]
        slopes = np.empty((*base.shape, count))
        for column, k in enumerate(range(len(own) - count, len(own))):
            moved = own.copy()
            moved[k] += self._steps[k]
            slopes[..., column] = (self._simulate(settled, moved, initial) - base) / self._steps[k]
        return slopes

    def _simulate_perturbed(self, settled: Floats, initial: Floats, own: Floats) -> Floats:
        batch = self.batch
        varied = settled[batch.rows] + _STEP * batch.row_change
        first = initial[batch.perturbation_run]
        first[:, 2] += _STEP * batch.turned
        return batch.perturbations.predict(
            varied, self._all(own), first, nodal_deviation=batch.nodal_deviation
        ).reshape(len(batch.perturbation_run), -1, 3)
