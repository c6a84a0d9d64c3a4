"""Free static maps: one value at each level that a command had, straight lines between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.calibration import RunMeasurement
from agvbench.effects import Effect
from agvbench.types import Commands, Floats, Run

ROLES = ("front", "rear", "drive")
_MOST_NODES = 40
_FEW_NODES = 16
_HELD_S = 0.25
_SLOWEST_MPS = 0.02


@dataclass(frozen=True)
class NodalMaps:
    """Commands at which the maps' values are free: ``nodes[role]`` ascending, neutral left out of the drive's.

    Their values stand one after another (front, rear, drive) in one vector. At neutral the drive stands still.
    """

    nodes: dict[str, Floats]
    neutral: float

    @property
    def size(self) -> int:
        """How many free values there are."""
        return sum(map(len, self.nodes.values()))

    @property
    def names(self) -> list[str]:
        """The values' names, such as ``front(1500)``."""
        return [f"{role}({c:g})" for role in ROLES for c in self.nodes[role]]

    def slices(self) -> dict[str, slice]:
        """Where each role's values are."""
        ends = np.cumsum([len(self.nodes[role]) for role in ROLES])
        return {role: slice(int(e) - len(self.nodes[role]), int(e)) for role, e in zip(ROLES, ends, strict=True)}

    def weights(self, role: str, command: Floats) -> Floats:
        """Return how the values at `command` (n,) follow from the free ones of `role`: (n, nodes)."""
        nodes = self.nodes[role]
        if role != "drive":
            return _interpolation(nodes, command)
        # Standing still at neutral is no parameter: it takes part in the interpolation with a value of zero.
        place = int(np.searchsorted(nodes, self.neutral))
        return np.delete(_interpolation(np.insert(nodes, place, self.neutral), command), place, axis=1)

    def beside(self, values: Floats, kind: type[Effect], parameters: Floats) -> Floats:
        """Return what `values` (size,) that were fitted without an effect of this kind are beside it."""
        laid = values.copy()
        for role in ("front", "rear"):
            own = self.slices()[role]
            at_neutral = float((self.weights(role, np.array([self.neutral])) @ values[own])[0])
            laid[own] = kind.beside(values[own], at_neutral, *parameters.tolist())
        return laid

    def interpolated(self, values: Floats, unobserved: NDArray[np.bool_]) -> Floats:
        """Return `values` (size,) with those that are `unobserved` interpolated between the others of their role.

        Where a role has no other, its values stay.
        """
        laid = values.copy()
        for role, own in self.slices().items():
            nodes, heard = self.nodes[role], ~unobserved[own]
            at, known = nodes[heard], values[own][heard]
            if role == "drive":
                place = int(np.searchsorted(at, self.neutral))
                at, known = np.insert(at, place, self.neutral), np.insert(known, place, 0.0)
            if len(at):
                laid[own] = np.where(heard, values[own], np.interp(nodes, at, known))
        return laid


def nodal_maps(runs: Sequence[Run], neutral: float) -> NodalMaps:
    """Return a node for every level at which the vehicle drove; where there are too many, for `chosen_levels`."""
    nodes = {}
    for role in ROLES:
        commanded, held_s = _driven_commands(runs, role, neutral)
        levels, which = np.unique(commanded, return_inverse=True)
        if len(levels) > _MOST_NODES:
            longest_s = np.zeros(len(levels))
            np.maximum.at(longest_s, which, held_s)
            levels = chosen_levels(levels, longest_s)
        nodes[role] = levels[levels != neutral] if role == "drive" else levels
    return NodalMaps(nodes, neutral)


def chosen_levels(levels: Floats, longest_s: Floats) -> Floats:
    """Return some of very many levels (n,), ascending: those that were held, and of the others what fills gaps.

    Oscillating steering passes many levels, a twentieth of a second each. Were nodes laid by how many levels there are,
    they would crowd where it oscillates, and leave an end stop elsewhere between two of them.

    Parameters
    ----------
    levels
        (n,): ascending.
    longest_s
        (n,): for how long each was held at most [s].
    """
    ends = np.isin(np.arange(len(levels)), (0, len(levels) - 1))
    held = (longest_s >= _HELD_S) | ends
    nodes = _spread(levels[ends], levels[held], 0.0, _MOST_NODES)
    return _spread(nodes, levels, float(np.ptp(levels)) / (_FEW_NODES - 1), _MOST_NODES)


def _spread(nodes: Floats, levels: Floats, near: float, most: int) -> Floats:
    """Return `nodes` and, one after another, the level farthest from all, until none is farther than `near`."""
    while len(nodes) < most:
        away = np.abs(levels[:, None] - nodes).min(axis=1)
        if away.max() <= near:
            break
        nodes = np.append(nodes, levels[np.argmax(away)])
    return np.sort(nodes)


def _driven_commands(runs: Sequence[Run], role: str, neutral: float) -> tuple[Floats, Floats]:
    """Return every command (n,) with which the vehicle drove, and for how long each was held [s]."""
    commanded, held_s = [], []
    for run in runs:
        values, t_s, driven = getattr(run.commands, role), run.commands.t_s, _driven_rows(run.commands, neutral)
        # A row begins where any command changes: this one may be held over many.
        initial_states = np.flatnonzero(np.r_[True, values[1:] != values[:-1]])
        ends_s = np.append(t_s[initial_states[1:]], max(float(np.max(run.frames.t_s, initial=-np.inf)), t_s[-1]))
        commanded.append(values[driven])
        held_s.append(np.repeat(ends_s - t_s[initial_states], np.diff(np.append(initial_states, len(values))))[driven])
    return np.concatenate(commanded), np.concatenate(held_s)


def _driven_rows(commands: Commands, neutral: float) -> NDArray[np.bool_]:
    return np.asarray(commands.drive != neutral)


def start_values(maps: NodalMaps, measured: Sequence[RunMeasurement], prior_model: dict[str, Floats]) -> Floats:
    """Return values to start a fit from: what steady drives imply by inverted kinematics, at their commands.

    Where no steady drive had the command, it is `believed[role]` (values at the nodes), moved by what measured nodes
    nearby were off by. A fit that starts far off may end anywhere.
    """
    values = []
    for role in ROLES:
        nodes = maps.nodes[role]
        known = np.full(len(nodes), np.nan)
        for k, node in enumerate(nodes):
            seen = [_implied(role, m) for m in measured if getattr(m.command, role) == node]
            seen = [v for v in seen if np.isfinite(v)]
            if seen:
                known[k] = float(np.median(seen))
        measured_here = np.isfinite(known)
        off = (known - prior_model[role])[measured_here]
        moved = prior_model[role] + (np.interp(nodes, nodes[measured_here], off) if len(off) else 0.0)
        values.append(np.where(measured_here, known, moved))
    return np.concatenate(values)


def _implied(role: str, m: RunMeasurement) -> float:
    if role != "drive":
        return float(getattr(m, f"{role}_rad")) if abs(m.speed_mps) > _SLOWEST_MPS else np.nan
    if not m.moves:
        return 0.0
    return float(m.speed_mps * 2.0 * np.cos(m.sideslip_rad) / (np.cos(m.front_rad) + np.cos(m.rear_rad)))


def _interpolation(nodes: Floats, command: Floats) -> Floats:
    out = np.zeros((len(command), len(nodes)))
    if len(nodes) < 2:
        out[:, :] = 1.0
        return out
    at = np.clip(command, nodes[0], nodes[-1])
    left = np.clip(np.searchsorted(nodes, at, side="right") - 1, 0, len(nodes) - 2)
    share = (at - nodes[left]) / (nodes[left + 1] - nodes[left])
    rows = np.arange(len(command))
    out[rows, left] = 1.0 - share
    out[rows, left + 1] += share
    return out
