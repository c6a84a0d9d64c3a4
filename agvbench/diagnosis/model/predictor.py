"""Predicted poses of all runs and their derivatives, by finite differences of simulations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.nodal_maps import ROLES
from agvbench.diagnosis.model.physical_priors import PhysicalPriors
from agvbench.diagnosis.model.repeats import Repeats
from agvbench.diagnosis.model.smoothness import PriorTerms
from agvbench.effects.base import Stage
from agvbench.model.simulation.layout import (
    BANDWIDTH,
    INITIAL_SIZE,
    INITIAL_SPEED,
    INITIAL_YAW_RATE,
    RECENT_SPEED,
    YAW_RATE_WEIGHT,
)
from agvbench.types import Floats


@dataclass(frozen=True)
class Linearised:
    """Predicted poses and their derivatives, stored for each run's active parameters only.

    ``poses`` (R, K, 3); ``own`` (R, m): indices of each run's active parameters, out of ``count`` (P); ``by_own``
    (R, K, 3, m): derivatives by these; ``by_random_effects`` (R, K, 3, q): by the q random effects of
    `Predictor.random_effects`. ``effects``: names of the effects' parameters, which are the last of the active ones in
    every run.
    """

    poses: Floats
    own: NDArray[np.int64]
    by_own: Floats
    by_random_effects: Floats
    count: int
    effects: tuple[str, ...] = ()

    @property
    def by_parameters(self) -> Floats:
        """The derivatives by all parameters (R, K, 3, P), as a dense array."""
        out = np.zeros((*self.poses.shape, self.count))
        np.put_along_axis(out, self.own[:, None, None, :], self.by_own, axis=-1)
        return out

    def with_last(self, slopes: Floats, names: Sequence[str]) -> Linearised:
        """Return this linearisation with derivatives (R, K, 3, q) by further parameters of effects, which come last."""
        more = np.arange(self.count, self.count + slopes.shape[-1])
        own = np.concatenate([self.own, np.broadcast_to(more, (len(self.own), len(more)))], axis=1)
        by_own = np.concatenate([self.by_own, slopes], axis=-1)
        return replace(self, own=own, by_own=by_own, count=self.count + len(more), effects=(*self.effects, *names))

    def by_first(self, count: int) -> Linearised:
        """Return this linearisation with derivatives by the first `count` parameters only: the maps', or none."""
        kept = self.own.shape[1] - (self.count - count) if count else 0
        return replace(self, own=self.own[:, :kept], by_own=self.by_own[..., :kept], count=count, effects=())

    def by_effects(self) -> dict[str, Floats]:
        """Return the derivatives (R, K, 3) by the parameters of effects, by name."""
        first = self.own.shape[1] - len(self.effects)
        return {name: self.by_own[..., first + k] for k, name in enumerate(self.effects)}


RANDOM_EFFECTS = ("x_m", "y_m", "heading_rad", "front_rad", "rear_rad", "log_speed")
"""The random effects of a run: its start pose, an offset of each axle, and the logarithm of a factor on speed."""

_OF_START = 3
"""How many of them are those of the start pose. Windows of free driving have no others: those would absorb causes,
because the errors of adjacent windows are correlated."""

_STEP = 1e-4  # rad, m/s
_STEP_SHARE = 1e-3
# A command that takes effect just as a window begins changes its initial state. With a short step, one such window
# would seem to determine a delay to microseconds.
_STEP_OF_DELAYS_S = 5e-3
MAX_ANGLE_RAD, MAX_YAW_RATE = 1.4, 30.0
"""Limits of the values of steering maps; what a fit puts beyond them counts as the limit."""


class Predictor:
    """Predicts runs with nodal maps and some effects; the parameters are the nodal values, then those of the effects.

    ``physical`` are the priors of the effects' parameters. ``random_effects`` names the q random effects of each run or
    window. Each derivative is a forward difference of two simulations.
    """

    def __init__(self, batch: Batch, effects: tuple[str, ...] = ()) -> None:
        self.batch, self.effects = batch, effects
        self.readings, self.maps = batch.readings, batch.maps
        self.random_effects = RANDOM_EFFECTS if self.readings.initial_states is None else RANDOM_EFFECTS[:_OF_START]
        self._own = np.concatenate([np.empty(0, dtype=np.int64), *(batch.base.indices(name) for name in effects)])
        self.parameter_names: list[str] = [batch.base.parameter_names[i] for i in self._own]
        self.nulls: Floats = batch.base.nulls[self._own]
        self.physical = PhysicalPriors.of(self.readings.priors, effects, self.parameter_names, self.nulls)
        own = [kind for kind in batch.base.kinds if kind.name in effects]
        alike = {kind.name for kind in own if kind.acts_alike_on_repeats()}
        declared = {f"{kind.name}.{p.name}": (kind, p) for kind in own for p in kind.parameters()}
        parameters = [declared[name] for name in self.parameter_names]
        self._acts_alike = np.array([kind.name in alike for kind, _ in parameters], dtype=np.bool_)
        self._is_discrete = np.array([p.is_discrete for _, p in parameters], dtype=np.bool_)
        self._steps = _STEP_SHARE * batch.base.scales[self._own]
        if self.readings.initial_states is not None:
            is_delay = [kind.stage == Stage.TRANSPORT and p.unit == "s" for kind, p in parameters]
            self._steps[np.array(is_delay, dtype=np.bool_)] = _STEP_OF_DELAYS_S
        self._last: tuple[tuple[bytes, ...], Floats] = (), np.empty(0)

    @property
    def steering_limits(self) -> tuple[float, float]:
        """The lowest and highest value of the steering maps: angles [rad], or a yaw rate [rad/s]."""
        most = MAX_YAW_RATE if self.batch.geometry.is_differential else MAX_ANGLE_RAD
        return -most, most

    def prior(self, parameters: Floats) -> PriorTerms:
        """Return the priors of the maps and of the effects at `parameters` (P,)."""
        of_maps = self.batch.smoothness.terms(parameters)
        if not len(self.physical):
            return of_maps
        return of_maps + self.physical.terms(parameters[self.maps.size :], self.maps.size)

    def prior_loss(self, parameters: Floats) -> float:
        """Return minus two log density of the priors at `parameters` (P,)."""
        return self.batch.smoothness.loss(parameters) + self.physical.loss(parameters[self.maps.size :])

    def no_random_effects(self) -> Floats:
        """Return random effects (R, q) of zero."""
        return np.zeros((len(self.readings), len(self.random_effects)))

    def settled(self, parameters: Floats) -> tuple[Floats, Floats]:
        """Return steady-state angles and speed of every row (rows, 3), and initial states (R, 8)."""
        return self._inputs(parameters, self.no_random_effects())

    def all_parameters(self, parameters: Floats) -> Floats:
        """Return the simulation's parameter vector (p,) for the predictor's `parameters` (P,)."""
        return self._all(parameters[self.maps.size :])

    def _all(self, own: Floats) -> Floats:
        values = self.batch.base.nulls.copy()
        values[self._own] = own
        return values

    def _inputs(self, parameters: Floats, random_effects: Floats) -> tuple[Floats, Floats]:
        """Return steady-state values of every row (rows, 3) and initial states (R, 8)."""
        where, run = self.maps.slices(), self.batch.base.row_runs
        values = [self.batch.weights[role] @ parameters[where[role]] for role in ROLES]
        if random_effects.shape[1] > _OF_START:
            front_rad, rear_rad, log_speed = random_effects[run, _OF_START:].T
            values = [values[0] + front_rad, values[1] + rear_rad, values[2] * np.exp(log_speed)]
        front, rear = (np.clip(value, *self.steering_limits) for value in values[:2])
        front = np.where(self.batch.acting["front"], front, 0.0)
        speed = np.where(self.batch.acting["drive"], values[2], 0.0)
        initial = np.zeros((len(self.readings), INITIAL_SIZE))
        initial[:, :3] = self.readings.start + random_effects[:, :_OF_START]
        initial[:, BANDWIDTH] = np.inf
        if self.readings.initial_states is not None:
            states = self.readings.initial_states
            initial[:, INITIAL_SPEED], initial[:, RECENT_SPEED] = states.speed_mps, states.recent_speed_mps
            if not self.readings.preset:
                initial[:, [INITIAL_YAW_RATE, YAW_RATE_WEIGHT]] = states.yaw_rate
            initial[:, BANDWIDTH] = states.bandwidth
        return np.column_stack([front, rear, speed]), initial

    def predict(self, parameters: Floats, random_effects: Floats | None = None) -> Floats:
        """Return poses (R, K, 3) for parameters (P,) and random effects (R, q), by default zero.

        The last result is cached and read-only: a fit is linearised where its last step was evaluated.
        """
        random_effects = self.no_random_effects() if random_effects is None else random_effects
        context = (parameters.tobytes(), random_effects.tobytes())
        if context != self._last[0]:
            settled, initial = self._inputs(parameters, random_effects)
            poses = self._simulate(settled, parameters[self.maps.size :], initial)
            poses.flags.writeable = False
            self._last = context, poses
        return self._last[1]

    def _simulate(self, settled: Floats, own: Floats, initial: Floats, runs: NDArray[np.int64] | None = None) -> Floats:
        poses = self.batch.base.predict(
            settled, self._all(own), initial, runs=runs, nodal_deviation=self.batch.nodal_deviation
        )
        return poses.reshape(len(self.readings), -1, 3)

    def linearise(self, parameters: Floats, random_effects: Floats, near: Linearised | None = None) -> Linearised:
        """Return poses and derivatives about parameters (P,) and random effects (R, q).

        If `near` is given, it supplies the derivatives by the nodal values, by the random effects, and by those
        parameters of effects that it has.
        """
        base, inputs = self.predict(parameters, random_effects), self._inputs(parameters, random_effects)
        if near is None:
            by_maps, known = self._by_maps(parameters, random_effects, base, *inputs), {}
        else:
            by_maps, known = replace(near.by_first(self.maps.size), poses=base), near.by_effects()
        repeats = self.batch.alike(base, inputs[1][:, 2])
        slopes = self._slopes(parameters, base, *inputs, len(self.parameter_names), known, repeats)
        return by_maps.with_last(slopes, self.parameter_names)

    def _by_maps(
        self, parameters: Floats, random_effects: Floats, base: Floats, settled: Floats, initial: Floats
    ) -> Linearised:
        """Return poses `base` with their derivatives by the nodal values and by the random effects."""
        perturbations = self.batch.perturbations
        changes = self._changes_by_perturbations(base, settled, initial, parameters[self.maps.size :])
        by_own = np.zeros((*base.shape, perturbations.active.shape[1]))
        columns = by_own.transpose(0, 3, 1, 2)
        by_random_effects = np.zeros((*base.shape, len(self.random_effects)))
        by_random_effects[:, :, 0, 0] = by_random_effects[:, :, 1, 1] = 1.0
        by_random_effects[..., 2] = (
            _turned_about(base, initial) if self._acts_alike.all() else changes[perturbations.heading]
        )
        for k, role in enumerate(ROLES):
            perturbed = perturbations.by_role[role]
            change = changes[perturbed.index]
            by_offset, by_level = self._chain_factors(role, parameters, random_effects, settled)
            by_run = perturbed.by_run
            if _OF_START + k < len(self.random_effects):
                offset = by_run.sums(change * by_offset[:, None, None])
                by_random_effects[by_run.key[:, 0], :, :, _OF_START + k] = offset
            weight = perturbed.weight * by_level[perturbed.term]
            run, column = perturbed.by_value.key.T
            columns[run, column] = perturbed.by_value.sums(change[perturbed.term] * weight[:, None, None])
        return Linearised(base, perturbations.active, by_own, by_random_effects, self.maps.size)

    def _chain_factors(
        self, role: str, parameters: Floats, random_effects: Floats, settled: Floats
    ) -> tuple[Floats, Floats]:
        """Return derivatives (n,) of the value that each perturbation of `role` changes.

        The first is by the run's random effect, the second by the level or nodal value.
        """
        perturbed = self.batch.perturbations.by_role[role]
        if role != "drive":
            return np.ones(len(perturbed.run)), np.ones(len(perturbed.run))
        log_speed = random_effects[perturbed.run, _OF_START + 2 :]
        factor = np.exp(log_speed[:, 0]) if log_speed.shape[1] else np.ones(len(perturbed.run))
        if self.batch.perturbations.by_node:
            return factor * parameters[self.maps.slices()[role]][perturbed.row], factor
        return settled[perturbed.row, 2], factor

    def by_last(
        self, parameters: Floats, random_effects: Floats, count: int, near: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Return poses (R, K, 3), and their derivatives by the last `count` parameters (R, K, 3, count).

        The poses `near` (R, K, 3), if given, are those without the effect of these parameters. The effect moves repeats
        of a run as it moves the run that represents them.
        """
        settled, initial = self._inputs(parameters, random_effects)
        if near is not None and self.batch.repeats.are_any and self._acts_alike[-count:].all():
            repeats = self.batch.alike(near, initial[:, 2])
            base = near + self._change(near, settled, parameters[self.maps.size :], initial, repeats)
        else:
            base = self.predict(parameters, random_effects)
            repeats = self.batch.alike(base, initial[:, 2])
        return base, self._slopes(parameters, base, settled, initial, count, {}, repeats)

    def _slopes(
        self,
        parameters: Floats,
        base: Floats,
        settled: Floats,
        initial: Floats,
        count: int,
        known: Mapping[str, Floats],
        repeats: Repeats,
    ) -> Floats:
        """Return the derivatives (R, K, 3, count) of poses `base` by the last `count` of the effects' parameters.

        Those in `known` are taken from there.
        """
        own = parameters[self.maps.size :]
        slopes = np.empty((*base.shape, count))
        for column, k in enumerate(range(len(own) - count, len(own))):
            name = self.parameter_names[k]
            if self._is_discrete[k]:
                slopes[..., column] = 0.0
                continue
            if name in known:
                slopes[..., column] = known[name]
                continue
            moved = own.copy()
            moved[k] += self._steps[k]
            change = self._change(base, settled, moved, initial, repeats if self._acts_alike[k] else None)
            slopes[..., column] = change / self._steps[k]
        return slopes

    def _change(self, base: Floats, settled: Floats, own: Floats, initial: Floats, repeats: Repeats | None) -> Floats:
        """Return by how much the poses differ from `base` (R, K, 3) with the effects' parameters `own`.

        If `repeats` are given, the runs that represent others are simulated.
        """
        if repeats is None or not repeats.are_any:
            return self._simulate(settled, own, initial) - base
        poses = self._simulate(settled, own, initial, repeats.simulated)
        changes = (poses - base)[repeats.representative]
        return repeats.turned(changes, np.arange(len(base)), initial[:, 2])

    def _changes_by_perturbations(self, base: Floats, settled: Floats, initial: Floats, own: Floats) -> Floats:
        """Return the derivatives (n, K, 3) by each perturbed level (or nodal value), and by the initial heading.

        Most commands before a window no longer act in it: their derivatives are zero, and are not simulated. Nor are
        those by the heading if no effect reads the place: `_turned_about` returns them.
        """
        batch, perturbations = self.batch, self.batch.perturbations
        perturbed = settled[perturbations.rows] + _STEP * perturbations.row_change
        first = initial[perturbations.run]
        first[:, 2] += _STEP * perturbations.heading
        repeats = batch.alike(base, initial[:, 2])
        representative = batch.perturbations_of(repeats)
        simulated = np.unique(representative)
        if self._acts_alike.all():
            simulated = simulated[~perturbations.heading[simulated]]
        past, run = perturbations.past[simulated], perturbations.run[simulated]
        if past.any():
            simulated = simulated[~past | self._past_acts(base, settled, initial, own)[run]]
        poses = base[perturbations.run]
        perturbations.simulation.predict(
            perturbed,
            self._all(own),
            first,
            runs=simulated,
            out=poses.reshape(-1, 3),
            nodal_deviation=batch.nodal_deviation,
        )
        changes = (poses - base[perturbations.run])[representative] / _STEP
        return repeats.turned(changes, perturbations.run, initial[:, 2])

    def _past_acts(self, base: Floats, settled: Floats, initial: Floats, own: Floats) -> NDArray[np.bool_]:
        """Return in which windows (R,) a change of all the commands that ended before it moves the poses `base`.

        What moves them less than `_STEP` times as far as the change is within the error of a forward difference.
        """
        moved = self._simulate(settled + _STEP * self.batch.perturbations.past_change, own, initial) - base
        return np.asarray(~np.all((np.abs(moved) <= _STEP * _STEP) | np.isnan(base), axis=(1, 2)))


def _turned_about(poses: Floats, initial: Floats) -> Floats:
    """Return the derivatives of poses (R, K, 3) by the heading of the start poses (R, ≥ 3) about which they turn."""
    x, y = (poses[..., k] - initial[:, None, k] for k in (0, 1))
    return np.stack([-y, x, np.ones_like(x)], axis=-1)
