"""How visible a hidden effect is, measured on the plant itself, and which other effects look the same.

What a bench can refit must not count as visible. Static maps are free values per command level; on a plant without
dynamics a change of a level's value is a change of the level. So maps are refitted by Gauss-Newton on the *commands*
of the base plant, and no model is asked.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from agvbench.simulator.hidden.base_vehicle import BaseVehicle
from agvbench.simulator.hidden.catalogue import library
from agvbench.simulator.hidden.plant import TURNAROUND_S, HiddenPlant
from agvbench.simulator.hidden.recipe import Recipe
from agvbench.simulator.hidden.reference_drives import ReferenceDrive, centred, path, reference_drives
from agvbench.simulator.hidden.truth import SealedTruth
from agvbench.types import Floats

LEVER_M = 0.15
"""What a heading error counts: it moves the ends of the vehicle by this much per radian."""
CAMERA_NOISE_M = 0.0005 / math.sqrt(5.0)
"""Per axis: five markers of 0.5 mm."""
REPEATS = 6
_STRETCH = 8.0
"""A session has about so many times the runs of the reference drives: each waits so many turnarounds."""
_STEPS = {"two_axle": 2.0, "differential": 0.002}
"""Command units by which a level is moved for its derivative: 0.2° or 1 mm/s, and 2 mm/s or 0.1°/s."""
_STOPS = {"two_axle": (0,), "differential": (0, 1, 2)}
"""Commands (drive, front, rear) whose neutral level is no free one: there the vehicle stops, or does not turn."""
_ROUNDS = 3
_UNBOUNDED = {
    "command_low": -1e6,
    "command_high": 1e6,
    "front_low": -1.4,
    "front_high": 1.4,
    "rear_low": -1.4,
    "rear_high": 1.4,
}
"""A map that is refitted may go beyond the vehicle's own range; no reference drive reaches an end stop."""

Paths = list[Floats]
Levels = dict[tuple[int, float], float]
Mechanism = Callable[[Sequence[float]], dict[str, float]]


@np.errstate(over="ignore")
def rms(residual: Floats) -> float:
    """Return the rms length of poses' differences, shape (n, 3) [m]; infinite if a drive is unstable."""
    return float(np.sqrt(np.mean(np.sum(residual**2, axis=1))))


def _scaled(poses: Floats) -> Floats:
    return poses * (1.0, 1.0, LEVER_M)


@dataclass(frozen=True)
class Separation:
    """Rms distances on the reference drives [floors], with static maps refitted and held; the floor [m]."""

    refitted: float
    held: float
    floor_m: float


class SeparationStudy:
    """Drives plants of one base vehicle through the reference drives.

    Parameters
    ----------
    base
        The vehicle.
    override
        Base constants that gave way to an effect.
    """

    def __init__(self, base: BaseVehicle, override: dict[str, float] | None = None) -> None:
        self._constants, self._run_variation = base.constants | (override or {}) | _UNBOUNDED, base.run_variation
        self._kinematics = base.kinematics
        self.drives = [centred(self.plant({}), drive) for drive in reference_drives(base)]
        self.base_path = self.paths({})
        self.floor_m = self._floor_m()
        self.levels = self._free_levels()
        self._columns: Floats | None = None

    def plant(self, mechanism: dict[str, float], *, run_variation: bool = False) -> HiddenPlant:
        """Return a plant with the mechanism's constants, without play unless it is asked for."""
        spread = self._run_variation if run_variation else (0.0, 0.0, 0.0)
        constants = self._constants | mechanism
        return HiddenPlant(constants, spread, 0, SealedTruth("nothing"), turnaround_s=_STRETCH * TURNAROUND_S)

    def paths(self, mechanism: dict[str, float], levels: Levels | None = None) -> Paths:
        """Return the paths of all drives, headings scaled to metres."""
        plant = self.plant(mechanism)
        return [_scaled(path(plant, _moved(drive, levels or {}))) for drive in self.drives]

    def difference(self, mechanism: dict[str, float]) -> Floats:
        """Return by how much the mechanism moves the paths with the maps held, shape (samples, 3) [m]."""
        return np.concatenate(self.paths(mechanism)) - np.concatenate(self.base_path)

    def columns(self) -> Floats:
        """Return the derivatives of the base plant's paths by every free level, shape (3 samples, levels)."""
        if self._columns is None:
            self._columns = np.column_stack([self._column(level) for level in self.levels])
        return self._columns

    def refitted(self, wanted: Floats) -> Floats:
        """Return what is left of paths (samples, 3) when the base plant's levels follow them."""
        values = np.zeros(len(self.levels))
        best = left = wanted - np.concatenate(self.base_path)
        for _ in range(_ROUNDS):
            values += np.linalg.lstsq(self.columns(), left.ravel(), rcond=1e-9)[0]
            levels = dict(zip(self.levels, values.tolist(), strict=True))
            left = wanted - np.concatenate(self.paths({}, levels))
            if rms(left) >= rms(best):
                break
            best = left
        return best

    def _column(self, level: tuple[int, float]) -> Floats:
        plant, step = self.plant({}), _STEPS[self._kinematics]
        parts = []
        for drive, before in zip(self.drives, self.base_path, strict=True):
            moved = _moved(drive, {level: step})
            same = moved == drive
            parts.append(np.zeros_like(before) if same else (_scaled(path(plant, moved)) - before) / step)
        return np.concatenate(parts).ravel()

    def _free_levels(self) -> list[tuple[int, float]]:
        """Return (column, command) of every level, save for neutral where it stops by definition."""
        neutral, stops = self.drives[0].rows[0][1], _STOPS[self._kinematics]
        found = {(i, row[1 + i]) for drive in self.drives for row in drive.rows for i in range(3)}
        return sorted((i, u) for i, u in found if i not in stops or u != neutral)

    def _floor_m(self) -> float:
        """Return the rms variation of the drives between runs, with the camera's noise."""
        plant = self.plant({}, run_variation=True)
        repeats = [
            np.concatenate([_scaled(path(plant, d, seed=1 + 100 * k + i)) for i, d in enumerate(self.drives)])
            for k in range(REPEATS)
        ]
        variance = np.sum(np.var(repeats, axis=0, ddof=1), axis=1).mean()
        return float(math.sqrt(variance + 2.0 * CAMERA_NOISE_M**2))


def _moved(drive: ReferenceDrive, levels: Levels) -> ReferenceDrive:
    """Return the drive with the commands of some levels moved."""
    rows = tuple((s, *(u + levels.get((i, u), 0.0) for i, u in enumerate(command))) for s, *command in drive.rows)
    return replace(drive, rows=rows)  # type: ignore[arg-type]


def separation(bench: SeparationStudy, mechanism: dict[str, float]) -> Separation:
    """Return how far a mechanism moves the reference drives.

    Parameters
    ----------
    bench
        Of the base vehicle.
    mechanism
        Constants that are not at their null.
    """
    moved = np.concatenate(bench.paths(mechanism))
    held = rms(moved - np.concatenate(bench.base_path))
    return Separation(rms(bench.refitted(moved)) / bench.floor_m, held / bench.floor_m, bench.floor_m)


def fit_mechanism(bench: SeparationStudy, wanted: Floats, constants: Mechanism, start: Sequence[float]) -> float:
    """Return the rms [m] that a mechanism leaves of `wanted` (samples, 3) when fitted together with all levels.

    Parameters
    ----------
    bench
        Of the base vehicle.
    wanted
        Paths to explain.
    constants
        From the mechanism's parameters to the plant's constants.
    start
        Where to begin.
    """
    values, levels = np.array(start, dtype=np.float64), np.zeros(len(bench.levels))
    scale = np.abs(values)
    left, best = _left(bench, wanted, constants, values, levels), math.inf
    for _ in range(2 * _ROUNDS):
        if rms(left) >= 0.97 * best:
            break
        best = rms(left)
        steps = 0.02 * scale
        columns = [
            (left - _left(bench, wanted, constants, values + np.eye(len(values))[i] * steps[i], levels)).ravel()
            / steps[i]
            for i in range(len(values))
        ]
        matrix = np.column_stack([bench.columns(), *columns])
        change = np.linalg.lstsq(matrix, left.ravel(), rcond=1e-9)[0]
        step = np.clip(change[len(levels) :], -0.7 * scale, 0.7 * scale)
        levels, values = levels + change[: len(levels)], values + step
        scale = np.maximum(np.abs(values), 0.05 * scale)
        left = _left(bench, wanted, constants, values, levels)
    return min(best, rms(left))


def _left(
    bench: SeparationStudy, wanted: Floats, constants: Mechanism, values: Floats, levels: Floats
) -> Floats:  # fmt: skip
    moves = dict(zip(bench.levels, levels.tolist(), strict=True))
    left: Floats = wanted - np.concatenate(bench.paths(constants(values.tolist()), moves))
    return left


INDISTINGUISHABLE = 1.0
"""An indistinguishable alternative leaves less than this [floors] of what an effect leaves when static maps alone are
refitted."""


def indistinguishable_effects(
    base: BaseVehicle, truth: SealedTruth, *, limit: float = INDISTINGUISHABLE
) -> dict[str, float]:
    """Return the library's effects that explain the reference drives of a plant with one hidden effect.

    Each is fitted to the plant's own paths together with every level of the static maps, by driving base plants.

    Parameters
    ----------
    base
        The plant's vehicle.
    truth
        What it hides.
    limit
        What an indistinguishable alternative may leave [floors].

    Returns
    -------
    Name to what it leaves [floors], the best first, without the hidden effect itself.
    """
    names = set(truth.library_names)
    bench = SeparationStudy(base, {k: v for k, v in truth.constants.items() if k in base.constants})
    mechanism = {k: v for k, v in truth.constants.items() if k not in base.constants}
    wanted = np.concatenate(bench.paths(mechanism))
    known = library(base.kinematics)
    left = {
        recipe.name: fit_recipe(bench, wanted, recipe) / bench.floor_m for recipe in known if recipe.name not in names
    }
    return {name: rest for name, rest in sorted(left.items(), key=lambda item: item[1]) if rest < limit}


def fit_recipe(bench: SeparationStudy, wanted: np.ndarray, recipe: Recipe) -> float:
    """Return the rms [m] that the best size of an effect leaves, begun from a small and, if signed, a negative one."""
    names = list(recipe.sizes)

    def constants(values: Sequence[float]) -> dict[str, float]:
        return recipe.constants(dict(zip(names, values, strict=True)))

    starts = [[_typical(recipe, name) for name in names]]
    return min(fit_mechanism(bench, wanted, _within(constants, names), start) for start in starts)


def _typical(recipe: Recipe, name: str) -> float:
    size = recipe.sizes[name]
    middle = 0.5 * (size.low + size.high)
    return middle if middle else 0.5 * size.high


_POSITIVE = ("_s", "rate_rad_per_s", "_radps2", "width", "width_rad", "front_rad", "rear_rad")


def _within(
    constants: Callable[[Sequence[float]], dict[str, float]], names: Sequence[str]
) -> Callable[[Sequence[float]], dict[str, float]]:
    """Keep times, rates and widths from turning negative on the way."""

    def bounded(values: Sequence[float]) -> dict[str, float]:
        kept = [max(1e-4, v) if n.endswith(_POSITIVE) else v for n, v in zip(names, values, strict=True)]
        return constants(kept)

    return bounded
