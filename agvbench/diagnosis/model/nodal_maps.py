"""Nodal maps: static maps with a free value at each of the driven command levels that are held, linear in between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.data.initial_pose import is_driven
from agvbench.effects import Effect
from agvbench.types import Command, Floats, Run

ROLES = ("front", "rear", "drive")
_MAX_NODES = 40
_UNIFORM_NODES = 16
_HELD_S = 0.25


@dataclass(frozen=True)
class NodalMaps:
    """The nodes of the static maps: ``nodes[role]`` are commands, ascending.

    One vector holds all nodal values, in the order front, rear, drive. Roles in ``zero_at_neutral`` have no node at
    neutral, where their value is zero: the speed of the drive, and the yaw rate of a differential vehicle, which has no
    nodes of a rear axle.
    """

    nodes: dict[str, Floats]
    neutral: Command
    zero_at_neutral: frozenset[str] = frozenset({"drive"})

    @property
    def size(self) -> int:
        """The number of nodal values."""
        return sum(map(len, self.nodes.values()))

    @property
    def names(self) -> list[str]:
        """The names of the nodal values, such as ``front(1500)``."""
        return [f"{role}({c:g})" for role in ROLES for c in self.nodes[role]]

    def slices(self) -> dict[str, slice]:
        """Return the slice of each role in the vector of nodal values."""
        ends = np.cumsum([len(self.nodes[role]) for role in ROLES])
        return {role: slice(int(e) - len(self.nodes[role]), int(e)) for role, e in zip(ROLES, ends, strict=True)}

    def weights(self, role: str, command: Floats) -> Floats:
        """Return the interpolation weights (n, nodes) of the nodal values of `role` at `command` (n,)."""
        nodes = self.nodes[role]
        if role not in self.zero_at_neutral:
            return _interpolation(nodes, command)
        # Neutral is a node with a fixed value of zero, not a parameter.
        neutral: float = getattr(self.neutral, role)
        place = int(np.searchsorted(nodes, neutral))
        # A direction that was never driven is taken for the mirror image of the other.
        below, above = (command < neutral) & (place == 0), (command > neutral) & (place == len(nodes))
        mirrored = below | above
        reflected = np.where(mirrored, 2.0 * neutral - command, command)
        weights = np.delete(_interpolation(np.insert(nodes, place, neutral), reflected), place, axis=1)
        return np.where(mirrored[:, None], -weights, weights)

    def beside(self, values: Floats, kind: type[Effect], parameters: Floats) -> Floats:
        """Return `values` (size,), fitted without an effect of this kind, converted for a model with it."""
        converted = values.copy()
        for role in ("front", "rear"):
            own = self.slices()[role]
            at_neutral = float((self.weights(role, np.array([getattr(self.neutral, role)])) @ values[own])[0])
            converted[own] = kind.beside(values[own], at_neutral, *parameters.tolist())
        return converted

    def interpolated(self, values: Floats, unobserved: NDArray[np.bool_]) -> Floats:
        """Return `values` (size,) with the `unobserved` ones interpolated between the observed ones of their role.

        A role without observed values is left unchanged.
        """
        filled = values.copy()
        for role, own in self.slices().items():
            nodes, observed = self.nodes[role], ~unobserved[own]
            at, known = nodes[observed], values[own][observed]
            if role in self.zero_at_neutral:
                neutral = getattr(self.neutral, role)
                place = int(np.searchsorted(at, neutral))
                at, known = np.insert(at, place, neutral), np.insert(known, place, 0.0)
            if len(at):
                filled[own] = np.where(observed, values[own], np.interp(nodes, at, known))
        return filled


def nodal_maps(runs: Sequence[Run], neutral: Command, *, is_differential: bool = False) -> NodalMaps:
    """Return maps with nodes at `select_levels` of the driven commands; `is_differential` as in `Geometry`."""
    nodes = {}
    zero_at_neutral = frozenset({"drive", "front"} if is_differential else {"drive"})
    for role in ROLES:
        if role == "rear" and is_differential:
            nodes[role] = np.empty(0)
            continue
        driven, held_s = _driven_commands(runs, role, neutral, on_the_spot=is_differential)
        levels, which = np.unique(driven, return_inverse=True)
        longest_s = np.zeros(len(levels))
        np.maximum.at(longest_s, which, held_s)
        levels = select_levels(levels, longest_s)
        nodes[role] = levels[levels != getattr(neutral, role)] if role in zero_at_neutral else levels
    return NodalMaps(nodes, neutral, zero_at_neutral)


def select_levels(levels: Floats, longest_s: Floats) -> Floats:
    """Return the levels that were held, and others that fill the gaps between these, ascending.

    A steering oscillation passes many levels, each for about 0.05 s. A node at each of them would absorb whatever the
    model lacks in that instant, by angles that no axle reaches. Nodes at quantiles of the levels would crowd in the
    range of the oscillation, and an end stop outside of it would lie between two nodes.

    Parameters
    ----------
    levels
        (n,): ascending.
    longest_s
        (n,): the longest time for which each level was held [s].
    """
    ends = np.isin(np.arange(len(levels)), (0, len(levels) - 1))
    held = (longest_s >= _HELD_S) | ends
    nodes = _add_farthest(levels[ends], levels[held], 0.0, _MAX_NODES)
    return _add_farthest(nodes, levels, float(np.ptp(levels)) / (_UNIFORM_NODES - 1), _MAX_NODES)


def _add_farthest(nodes: Floats, levels: Floats, near: float, most: int) -> Floats:
    """Add the level farthest from all nodes, one at a time, until all are within `near` or there are `most` nodes."""
    while len(nodes) < most:
        distance = np.abs(levels[:, None] - nodes).min(axis=1)
        if distance.max() <= near:
            break
        nodes = np.append(nodes, levels[np.argmax(distance)])
    return np.sort(nodes)


def _driven_commands(runs: Sequence[Run], role: str, neutral: Command, *, on_the_spot: bool) -> tuple[Floats, Floats]:
    """Return every command (n,) under which the vehicle was driven, and the time for which each was held [s].

    A vehicle that turns `on_the_spot` is driven by its front command, too.
    """
    commands, held_s = [], []
    for run in runs:
        values, t_s = getattr(run.commands, role), run.commands.t_s
        driven = is_driven(run.commands, neutral, turns_on_the_spot=on_the_spot)
        # A row begins where any command changes, so that one command may be held over many rows.
        changes = np.flatnonzero(np.r_[True, values[1:] != values[:-1]])
        ends_s = np.append(t_s[changes[1:]], max(float(np.max(run.frames.t_s, initial=-np.inf)), t_s[-1]))
        commands.append(values[driven])
        held_s.append(np.repeat(ends_s - t_s[changes], np.diff(np.append(changes, len(values))))[driven])
    return np.concatenate(commands), np.concatenate(held_s)


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
