"""A grid: which bench sessions a sweep holds, from a TOML file."""

from __future__ import annotations

import hashlib
import json
import math
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import msgspec

from agvbench.adapters import check_specs
from agvbench.adapters.contract import named_values
from agvbench.adapters.impairment.spec import unimpaired
from agvbench.errors import AgvbenchError, FileError, OneOf
from agvbench.planning.trajectories.loading import driven_trajectories, load_trajectory
from agvbench.planning.workspace import Workspace
from agvbench.running.configuration.benchmark_files import find_benchmark
from agvbench.running.configuration.settings import BenchSettings
from agvbench.running.configuration.vehicles import known_models, with_lab_vehicle
from agvbench.running.session.rig_checks import adapter_options
from agvbench.simulator import load_plant
from agvbench.text_files import read_toml
from agvbench.validation import convert
from agvbench.workflows.sweep.axes import Axis, axes_of, fixed_options

MOST_CELLS = 10_000_000
_DEFAULT = ["calibration", "trajectories"]
_SIMULATED = {"agv": ("sim", "simavr"), "mocap": ("sim", "natnet:emulated")}


class _File(msgspec.Struct, forbid_unknown_fields=True):
    """The tables of the file."""

    benchmarks: list[str] = msgspec.field(default_factory=lambda: list(_DEFAULT))
    fixed: dict[str, Any] = msgspec.field(default_factory=dict)
    grid: dict[str, Any] = msgspec.field(default_factory=dict)


@dataclass(frozen=True)
class Grid:
    """Bench sessions: every combination of the values of the axes, the last axis fastest.

    A cell is made when it is asked for: a million of them take no memory.
    """

    benchmarks: tuple[str, ...]
    fixed: dict[str, Any]
    axes: tuple[Axis, ...]

    def __len__(self) -> int:
        return math.prod(len(axis.values) for axis in self.axes)

    def values(self, cell: int) -> tuple[Any, ...]:
        """Return the value of each axis in a cell, numbered from 0."""
        found = []
        for axis in reversed(self.axes):
            cell, place = divmod(cell, len(axis.values))
            found.append(axis.values[place])
        return tuple(reversed(found))

    def options(self, cell: int) -> dict[str, Any]:
        """Return the options of the bench in a cell."""
        return self._options(self.values(cell))

    def _options(self, values: tuple[Any, ...]) -> dict[str, Any]:
        options = dict(self.fixed)
        for axis, value in zip(self.axes, values, strict=True):
            if axis.parameter:
                options[axis.option] = ",".join(filter(None, (options.get(axis.option, ""), axis.given(value))))
            else:
                options[axis.option] = value
        return options

    def along(self, axis: Axis) -> Iterator[dict[str, Any]]:
        """Yield the options with each value of one axis, the others at their first; of a range, its two ends."""
        chosen = (axis.values[0], axis.values[-1]) if isinstance(axis.values, range) else axis.values
        for value in chosen:
            yield self._options(tuple(value if one is axis else one.values[0] for one in self.axes))

    @property
    def digest(self) -> str:
        """SHA-256 of everything that decides which cells there are."""
        axes = [(a.name, [a.values[0], a.values[-1]] if isinstance(a.values, range) else a.values) for a in self.axes]
        text = json.dumps([self.benchmarks, self.fixed, axes], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


def read_grid(path: Path) -> Grid:
    """Read a grid and check every option and value of it.

    Raises
    ------
    FileError
        If the file cannot be read, or an option or a value cannot be used; the error names its place in the file.
    """
    try:
        table = read_toml(path)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(
            "is no grid that can be read", where=path, value=reason, remedy="see agvbench sweep --help"
        ) from None
    content = convert(table, _File, where=str(path))
    fixed = fixed_options(content.fixed, f"{path}: fixed")
    grid = Grid(tuple(content.benchmarks), fixed, tuple(axes_of(content.grid, f"{path}: grid")))
    _check(grid, path)
    return grid


def _check(grid: Grid, path: Path) -> None:
    if not grid.axes:
        raise FileError("has no axis", where=f"{path}: grid", remedy='add a list, such as seed = "1..20"')
    if len(grid) > MOST_CELLS:
        raise FileError("has too many cells", where=path, value=len(grid), limit=MOST_CELLS, remedy="split it")
    if not grid.benchmarks:
        raise FileError("names no benchmark", where=f"{path}: benchmarks", remedy="leave it out for the usual ones")
    for name in grid.benchmarks:
        _at(f"{path}: benchmarks", partial(find_benchmark, name))
    _require_apart(grid, path)
    checked: set[str] = set()
    for axis in grid.axes:
        for options in grid.along(axis):
            _at(f"{path}: grid: {axis.name}", partial(_check_options, options, checked))


def _require_apart(grid: Grid, path: Path) -> None:
    """Raise `FileError` if an option, or a parameter of one, is both fixed and on an axis, or twice on one."""
    taken = set(grid.fixed) - {axis.option for axis in grid.axes if axis.parameter}
    for option in {axis.option for axis in grid.axes if axis.parameter} & set(grid.fixed):
        taken |= {f"{option}.{name}" for name in named_values([grid.fixed[option]], f"--{option}")}
    for axis in grid.axes:
        if axis.name in taken:
            raise FileError("is in [fixed] and in [grid]", where=path, value=axis.name, remedy="leave it out of one")


def _at(where: str, act: Callable[[], object]) -> None:
    """Have an error say where in the file its cause is."""
    try:
        act()
    except AgvbenchError as error:
        inner = where if error.where is None else f"{where}: {error.where}"
        raise FileError(error.what, where=inner, value=error.value, limit=error.limit, remedy=error.remedy) from error


def _check_options(options: dict[str, Any], checked: set[str]) -> None:
    """Raise `AgvbenchError` if a bench session could not begin with these options; `checked` are known to be good."""
    settings = BenchSettings.given(with_lab_vehicle(options))
    parts = json.dumps({name: value for name, value in options.items() if name != "seed"}, sort_keys=True)
    if parts in checked:
        return
    checked.add(parts)
    _require_simulated(settings)
    Workspace.parse(settings.workspace)
    for name in driven_trajectories(settings.trajectories) if settings.trajectories else ():
        load_trajectory(name)
    rig = adapter_options(settings, known_models(settings))
    check_specs(settings.agv, settings.mocap, rig)
    load_plant(rig.plant, rig.plant_options)(rig.seed)


def _require_simulated(settings: BenchSettings) -> None:
    """Raise `FileError` unless no hardware is driven: sessions of a sweep run at the same time, unobserved."""
    for name, known in _SIMULATED.items():
        spec = unimpaired(getattr(settings, name))
        if spec.partition(":")[0] not in known and spec not in known:
            raise FileError("a sweep drives simulated vehicles only", where=f"--{name}", value=spec, limit=OneOf(known))
