"""Registry of effects: every module of this package that defines an `Effect` registers it by its name."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import Any

from agvbench.effects.base import Effect
from agvbench.errors import OneOf, VehicleError
from agvbench.registry import classes_by_file


@cache
def effect_kinds() -> Mapping[str, type[Effect]]:
    """Return every effect's class by its name, in alphabetical order."""
    kinds = {cls.name: cls for cls in classes_by_file("agvbench.effects", Effect)}
    return MappingProxyType(dict(sorted(kinds.items())))


def effect_from_toml(table: object, *, where: str = "effect") -> Effect:
    """Build the effect that a TOML table describes; its key ``name`` says which.

    Raises
    ------
    VehicleError
        If the name is missing or unknown, or the parameters do not fit it.

    Examples
    --------
    >>> effect_from_toml({"name": "steering_lag", "time_constant_s": 0.2})
    SteeringLag(time_constant_s=0.2)
    """
    if not isinstance(table, Mapping):
        raise VehicleError("must be a table", where=where, value=repr(table))
    # Variants derive from classes of this package, and are therefore imported here only.
    from agvbench.effects.variants import effect_variants

    kinds: dict[str, type[Effect]] = {**effect_kinds(), **effect_variants()}
    name: Any = table.get("name")
    if name is None:
        raise VehicleError("a key is missing", where=where, value="name", remedy=f'add name = "{next(iter(kinds))}"')
    if not isinstance(name, str) or name not in kinds:
        raise VehicleError("unknown effect", where=f"{where}.name", value=repr(name), limit=OneOf(kinds))
    return kinds[name].from_toml(table, where=where)
