"""Prior of the nodal values: a static map bends little between commands that are close together.

Neighbouring nodes of a map may be driven in different directions, with different histories or in a single group of
repeats. Without a prior each node absorbs whatever the model lacks in its own runs: a difference between forward and
backward becomes a difference between neighbouring commands, and is not seen.

The slope of a map is a random walk over the commands, so that the map is an integrated Wiener process (Wahba, JRSS B
40, 1978), observed with a small independent deviation of each level. Changes of slope have Student's t distribution:
end stops and dead bands are kinks, which few nodes have.

Free driving needs the prior as much, although its nodes are few: its commands are steered by a person, so that levels
are driven unequally often, and errors of windows are many times as large as those of runs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agvbench.diagnosis.criteria import MAPS
from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.model.nodal_maps import NodalMaps
from agvbench.types import Floats

_TYPICAL_ANGLE_RAD = np.pi / 4.0
_FAST_QUANTILE = 0.95


@dataclass(frozen=True)
class PriorTerms:
    """A prior at some parameters: its ``loss`` (minus two log density), ``information`` and ``gradient``.

    ``information`` (P, P) and ``gradient`` (P,) are of all parameters; those of the maps' prior are zero for parameters
    of effects. The gradient is minus half the derivative of the loss, as that of the likelihood. ``of_effects`` is the
    part of the loss that belongs to priors of effects.
    """

    loss: float
    information: Floats
    gradient: Floats
    of_effects: float = 0.0

    def __add__(self, other: PriorTerms) -> PriorTerms:
        return PriorTerms(
            self.loss + other.loss,
            self.information + other.information,
            self.gradient + other.gradient,
            self.of_effects + other.of_effects,
        )


@dataclass(frozen=True)
class SmoothnessPrior:
    """Prior of the changes of slope of the maps.

    ``changes`` (N, nodal values): the changes of slope at N inner nodes as linear functions of the nodal values;
    ``scale`` (N,): their standard deviations.
    """

    changes: Floats
    scale: Floats

    @classmethod
    def of(cls, maps: NodalMaps, readings: Readings) -> SmoothnessPrior:
        """Return the prior for these maps, whose typical values are those of the `readings`."""
        rows: list[Floats] = []
        scales: list[float] = []
        sizes = _typical_values(maps, readings)
        for role, own in maps.slices().items():
            neutral = getattr(maps.neutral, role) if role in maps.zero_at_neutral else None
            for row, scale in _slope_changes(maps.nodes[role], neutral, sizes[role]):
                rows.append(np.zeros(maps.size))
                rows[-1][own] = row
                scales.append(scale)
        return cls(np.reshape(rows, (len(rows), maps.size)), np.asarray(scales))

    def terms(self, parameters: Floats) -> PriorTerms:
        """Return the prior at `parameters` (P,), whose first are the nodal values."""
        count, maps = len(parameters), self.changes.shape[1]
        information, gradient = np.zeros((count, count)), np.zeros(count)
        values, freedom = parameters[:maps], MAPS.kink_degrees_of_freedom
        whitened = self.changes / self.scale[:, None]
        z = whitened @ values
        weighted = whitened * ((freedom + 1.0) / (freedom + z * z))[:, None]
        information[:maps, :maps] = weighted.T @ whitened
        gradient[:maps] = -weighted.T @ z
        return PriorTerms(self.loss(parameters), information, gradient)

    def loss(self, parameters: Floats) -> float:
        """Return minus two log density at `parameters` (P,), less that of straight maps."""
        z = (self.changes @ parameters[: self.changes.shape[1]]) / self.scale
        freedom = MAPS.kink_degrees_of_freedom
        return float((freedom + 1.0) * np.sum(np.log1p(z * z / freedom)))


def _typical_values(maps: NodalMaps, readings: Readings) -> dict[str, float]:
    """Return a typical value of each map at the end of its range: angles, a speed, or a yaw rate."""
    turns = np.abs(np.diff(readings.poses[..., 2], axis=1))
    front = _fast(readings, turns) if "front" in maps.zero_at_neutral else _TYPICAL_ANGLE_RAD
    return {"front": front, "rear": _TYPICAL_ANGLE_RAD, "drive": typical_speed_mps(readings)}


def typical_speed_mps(readings: Readings) -> float:
    """Return the speed that the vehicle exceeds in a twentieth of its samples."""
    steps = np.diff(readings.poses[..., :2], axis=1)
    return _fast(readings, np.hypot(steps[..., 0], steps[..., 1]))


def _fast(readings: Readings, steps: Floats) -> float:
    """Return the rate of change that the vehicle exceeds in a twentieth of its samples, from `steps` between them."""
    both = readings.seen[:, 1:] & readings.seen[:, :-1]
    duration_s = np.diff(readings.t_s, axis=1)
    moving = both & (duration_s > 0.0)
    fast = float(np.quantile(steps[moving] / duration_s[moving], _FAST_QUANTILE)) if moving.any() else 0.0
    return fast or 1.0


def _slope_changes(nodes: Floats, neutral: float | None, size: float) -> list[tuple[Floats, float]]:
    """Return the change of slope at each inner node (nodes,) with its standard deviation.

    `size` is a typical value of the map at the end of its range. A drive is at rest at its `neutral` command: this node
    is known, and both directions of travel have slopes of their own.
    """
    if len(nodes) < 2:
        return []
    at = nodes if neutral is None else np.sort(np.append(nodes, neutral))
    half_range = 0.5 * float(np.ptp(at))
    out = []
    for k in range(1, len(at) - 1):
        if at[k] == neutral:
            continue
        before, after = at[k] - at[k - 1], at[k + 1] - at[k]
        row = np.zeros(len(at))
        row[k - 1], row[k], row[k + 1] = 1.0 / before, -1.0 / before - 1.0 / after, 1.0 / after
        change = np.sqrt(0.5 * (before + after) / half_range) * MAPS.slope_change * size / half_range
        scale = float(np.hypot(change, MAPS.deviation * size * np.linalg.norm(row)))
        out.append((np.delete(row, np.flatnonzero(at == neutral)), scale))
    return out
