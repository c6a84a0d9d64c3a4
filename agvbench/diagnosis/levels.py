"""Free static maps: one value at each level that a command had, straight lines between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agvbench.calibration import RunMeasurement
from agvbench.types import Commands, Floats, Run

ROLES = ("front", "rear", "drive")
_MOST_NODES = 40
_FEW_NODES = 16
_SLOWEST_MPS = 0.02


@dataclass(frozen=True)
class FreeMaps:
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


def free_maps(runs: Sequence[Run], neutral: float) -> FreeMaps:
    """Return a node for every level at which the vehicle drove; where there are too many, for quantiles of them."""
    driven = [_driven_rows(run.commands, neutral) for run in runs]
    nodes = {}
    for role in ROLES:
        levels = np.unique(
            np.concatenate([getattr(run.commands, role)[d] for run, d in zip(runs, driven, strict=True)])
        )
        if len(levels) > _MOST_NODES:
            levels = np.unique(np.quantile(levels, np.linspace(0.0, 1.0, _FEW_NODES)))
        nodes[role] = levels[levels != neutral] if role == "drive" else levels
    return FreeMaps(nodes, neutral)


def _driven_rows(commands: Commands, neutral: float) -> NDArray[np.bool_]:
    return np.asarray(commands.drive != neutral)


def start_values(maps: FreeMaps, measured: Sequence[RunMeasurement], believed: dict[str, Floats]) -> Floats:
    """Return values to start a fit from: what steady drives imply by inverted kinematics, at their commands.

    Where no steady drive had the command, it is `believed[role]` (values at the nodes), moved by what the
    measured nodes were off by in the median.
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
        off = np.nanmedian(known - believed[role]) if role != "drive" and np.isfinite(known).any() else 0.0
        values.append(np.where(np.isfinite(known), known, believed[role] + off))
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
