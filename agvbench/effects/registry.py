"""Registry of effects: every module of this package, its folders and the user's own folder registers its effect."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from agvbench.effects.base import Effect
from agvbench.effects.declaration import check_declaration, source_of
from agvbench.effects.variants import Variant, effect_variants
from agvbench.errors import FileError, OneOf, VehicleError
from agvbench.own_modules import OwnModules
from agvbench.registry import classes_in_folders, own_classes

OWN_EFFECTS = OwnModules("effects", "agvbench.effects", "agvbench_own_effects", "docs/how-to/write-an-effect.md")
"""Effects of the user: the files of the folder ``effects`` in the current folder that import `agvbench.effects`."""


@cache
def effect_kinds() -> Mapping[str, type[Effect]]:
    """Return every effect's class by its name, in alphabetical order; own effects follow in the same order.

    Own effects are those of the folder ``effects`` in the current folder; see `OWN_EFFECTS`.

    Raises
    ------
    FileError
        If a file cannot be imported, the class in it is incomplete, or its name is taken.
    """
    try:
        found = [cls for cls in classes_in_folders("agvbench.effects", Effect) if not issubclass(cls, Variant)]
        own = [cls for module in OWN_EFFECTS.load() for cls in own_classes(module, Effect)]
    except Exception as error:
        raise OWN_EFFECTS.import_error(error, Path(__file__).parent) from error
    for cls in (*found, *own):
        check_declaration(cls)
    kinds = {cls.name: cls for cls in sorted(found, key=_name)}
    for cls in sorted(own, key=_name):
        if kinds.setdefault(cls.name, cls) is not cls:
            raise FileError("there is an effect of this name", where=source_of(cls), value=cls.name, remedy="rename it")
    return MappingProxyType(kinds)


def _name(kind: type[Effect]) -> str:
    return kind.name


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
    kinds: dict[str, type[Effect]] = {**effect_kinds(), **effect_variants()}
    name: Any = table.get("name")
    if name is None:
        raise VehicleError("a key is missing", where=where, value="name", remedy=f'add name = "{next(iter(kinds))}"')
    if not isinstance(name, str) or name not in kinds:
        raise VehicleError("unknown effect", where=f"{where}.name", value=repr(name), limit=OneOf(kinds))
    return kinds[name].from_toml(table, where=where)
