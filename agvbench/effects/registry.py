"""Find effects by file: a module in this package that defines an `Effect` adds its name."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from agvbench.effects.base import Effect
from agvbench.errors import VehicleError


@cache
def effect_kinds() -> Mapping[str, type[Effect]]:
    """Return every effect's class by its name, in alphabetical order."""
    package = __name__.rpartition(".")[0]
    kinds: dict[str, type[Effect]] = {}
    for module_info in pkgutil.iter_modules([str(Path(__file__).parent)]):
        module = importlib.import_module(f"{package}.{module_info.name}")
        for _, cls in inspect.getmembers(module, inspect.isclass):
            if issubclass(cls, Effect) and cls is not Effect and cls.__module__ == module.__name__:
                kinds[cls.name] = cls
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
    kinds = effect_kinds()
    name: Any = table.get("name")
    if name is None:
        raise VehicleError("a key is missing", where=where, value="name", remedy=f'add name = "{next(iter(kinds))}"')
    if not isinstance(name, str) or name not in kinds:
        raise VehicleError("unknown effect", where=f"{where}.name", value=repr(name), limit=", ".join(kinds))
    return kinds[name].from_toml(table, where=where)
