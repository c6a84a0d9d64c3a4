"""Find static maps by file: a module in this package that defines a `StaticMap` adds its kind."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import Any

from agvbench.errors import VehicleError
from agvbench.registry import classes_by_file
from agvbench.vehicle.maps.base import StaticMap


@cache
def map_kinds() -> Mapping[str, type[StaticMap]]:
    """Return every kind of map with its class, in alphabetical order."""
    kinds = {cls.kind: cls for cls in classes_by_file("agvbench.vehicle.maps", StaticMap)}  # type: ignore[type-abstract]
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
