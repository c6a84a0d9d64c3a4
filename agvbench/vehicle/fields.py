"""Fields of frozen dataclasses: checked on construction, read from TOML tables and written to them."""

from __future__ import annotations

import dataclasses
import difflib
import math
from collections.abc import Collection, Mapping
from itertools import pairwise
from typing import Any, TypeVar, get_type_hints

from agvbench.errors import VehicleError

T = TypeVar("T")


def coerce_float(instance: object, *names: str, allow_infinite: bool = False) -> None:
    """Turn the named fields of a frozen dataclass into floats.

    Raise `VehicleError` if one is no number, NaN, or infinite where that is not allowed.
    """
    for name in names:
        raw = getattr(instance, name)
        try:
            value = float(raw)
        except (TypeError, ValueError):
            raise VehicleError("must be a number", where=name, value=repr(raw)) from None
        if math.isnan(value) or (math.isinf(value) and not allow_infinite):
            raise VehicleError("must be a finite number", where=name, value=value)
        object.__setattr__(instance, name, value)


def require_positive(instance: object, *names: str) -> None:
    """Raise `VehicleError` unless the named fields are greater than zero."""
    for name in names:
        value = getattr(instance, name)
        if not value > 0.0:
            raise VehicleError("must be greater than zero", where=name, value=value)


def require_ascending(instance: object, *names: str, strict: bool = True) -> None:
    """Raise `VehicleError` unless the named fields ascend in the order given."""
    for low_name, high_name in pairwise(names):
        low, high = getattr(instance, low_name), getattr(instance, high_name)
        if high < low or (strict and high == low):
            limit = f"{'more than' if strict else 'at least'} {low_name} = {low}"
            raise VehicleError("is too low", where=high_name, value=high, limit=limit)


def from_table(cls: type[T], table: Mapping[str, Any], *, where: str) -> T:
    """Build the dataclass `cls` from a TOML table whose keys are its fields.

    Fields may be ``float``, ``str`` or ``tuple[float, ...]``; those with a default may be left out.

    Raises
    ------
    VehicleError
        If a key is missing or unknown, a value has the wrong type, or `cls` refuses the values.
    """
    fields = {f.name: f for f in dataclasses.fields(cls)}  # type: ignore[arg-type]
    check_keys(table, fields, where=where)
    hints = get_type_hints(cls)
    values = {}
    for name, field in fields.items():
        if name in table:
            values[name] = _convert(table[name], hints[name], where=f"{where}.{name}")
        elif field.default is dataclasses.MISSING:
            raise VehicleError("a key is missing", where=where, value=name, remedy=f"add {name} = …")
    try:
        return cls(**values)
    except VehicleError as error:
        raise located(error, where) from None


def to_table(instance: Any) -> dict[str, Any]:
    """Return the fields of a dataclass as a TOML table."""
    values = ((f.name, getattr(instance, f.name)) for f in dataclasses.fields(instance))
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values}


def check_keys(table: Mapping[str, Any], known: Collection[str], *, where: str) -> None:
    """Raise `VehicleError` if `table` has a key that is not `known`, naming the closest one that is."""
    for key in table:
        if key not in known:
            close = difflib.get_close_matches(key, known, n=1)
            remedy = f"did you mean {close[0]}?" if close else f"known keys: {', '.join(known)}"
            raise VehicleError("unknown key", where=where, value=key, remedy=remedy)


def located(error: VehicleError, where: str) -> VehicleError:
    """Return `error` as seen from `where`: ``maps.front`` + ``slope`` is ``maps.front.slope``."""
    place = where if error.where is None else f"{where}.{error.where}"
    return VehicleError(error.what, where=place, value=error.value, limit=error.limit, remedy=error.remedy)


def number(value: object, *, where: str) -> float:
    """Return a TOML integer or float as a float, infinities included; raise `VehicleError` if it is neither, or NaN."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise VehicleError("must be a number", where=where, value=repr(value))
    if math.isnan(value):
        raise VehicleError("must be a number", where=where, value="NaN")
    return float(value)


def _convert(value: object, hint: object, *, where: str) -> object:
    if hint is float:
        return number(value, where=where)
    if hint == tuple[float, ...]:
        if not isinstance(value, (list, tuple)):
            raise VehicleError("must be a list of numbers", where=where, value=repr(value))
        return tuple(number(item, where=f"{where}[{i}]") for i, item in enumerate(value))
    if not isinstance(value, str):
        raise VehicleError("must be a text", where=where, value=repr(value))
    return value
