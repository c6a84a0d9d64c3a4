"""Find static maps by file: a module in this package that defines a `StaticMap` adds its kind."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from agvbench.errors import VehicleError
from agvbench.vehicle.maps.base import StaticMap


@cache
def map_kinds() -> Mapping[str, type[StaticMap]]:
    """Return every kind of map with its class, in alphabetical order."""
    package = __name__.rpartition(".")[0]
    kinds: dict[str, type[StaticMap]] = {}
    for module_info in pkgutil.iter_modules([str(Path(__file__).parent)]):
        module = importlib.import_module(f"{package}.{module_info.name}")
        for _, cls in inspect.getmembers(module, inspect.isclass):
            if issubclass(cls, StaticMap) and not inspect.isabstract(cls) and cls.__module__ == module.__name__:
                kinds[cls.kind] = cls
    return MappingProxyType(dict(sorted(kinds.items())))


def map_from_toml(table: object, *, where: str = "map") -> StaticMap:
    """Build the map that a TOML table describes; its key ``kind`` says which.

    Raises
    ------
    VehicleError
        If the kind is missing or unknown or the rest does not fit it.

    Examples
    --------
    >>> map_from_toml({"kind": "line", "slope": 0.5, "intercept": 0})
    Line(slope=0.5, intercept=0.0, command_low=-inf, command_high=inf)
    """
    if not isinstance(table, Mapping):
        raise VehicleError("must be a table", where=where, value=repr(table))
    kinds = map_kinds()
    kind: Any = table.get("kind")
    if kind is None:
        raise VehicleError("a key is missing", where=where, value="kind", remedy=f'add kind = "{next(iter(kinds))}"')
    if not isinstance(kind, str) or kind not in kinds:
        raise VehicleError("unknown kind of map", where=f"{where}.kind", value=repr(kind), limit=", ".join(kinds))
    return kinds[kind].from_toml(table, where=where)
