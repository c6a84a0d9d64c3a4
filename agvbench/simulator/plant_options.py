"""Options of a plant: what ``--plant-option NAME=VALUE`` gives, as keyword arguments of the plant's factory."""

from __future__ import annotations

import difflib
import inspect
import math
import types
from collections.abc import Callable, Mapping
from inspect import Parameter
from typing import Any, get_args

from agvbench.errors import FlagError, OneOf

FLAG = "--plant-option"
_KINDS: Mapping[str, type] = {"float": float, "int": int, "bool": bool, "str": str}
_TRUTHS = {"true": True, "false": False}
_NAMED = (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)


def plant_keywords(factory: Callable[..., Any], given: Mapping[str, str | float], plant: str) -> dict[str, Any]:
    """Return the options `given` as keyword arguments of the factory of `plant`, each in the type that it declares.

    The type of a parameter is its annotation (``float``, ``int``, ``bool``, ``str``, or one of them or None), else the
    type of its default; without both a value that reads as a number is one. The first parameter is the seed.

    Raises
    ------
    FlagError
        If the factory has no such parameter, a value is not of its type, or a parameter without default is not given.

    Examples
    --------
    >>> def make_plant(seed, *, gain: float = 1.0, wheels: int = 4): ...
    >>> plant_keywords(make_plant, {"gain": "0.5"}, "my_plant.py:make_plant")
    {'gain': 0.5}
    >>> plant_keywords(make_plant, {"gian": "0.5"}, "my_plant.py:make_plant")
    Traceback (most recent call last):
    agvbench.errors.FlagError: --plant-option: not an option of my_plant.py:make_plant: 'gian' (one of: gain, wheels); \
did you mean 'gain'?
    """
    parameters = _parameters(factory)
    named = {p.name: p for p in parameters if p.kind in _NAMED}
    takes_any = any(p.kind is Parameter.VAR_KEYWORD for p in parameters)
    for name in given:
        if name not in named and not (takes_any and name.isidentifier()):
            raise _unknown(name, list(named), plant)
    for parameter in named.values():
        if parameter.default is Parameter.empty and parameter.name not in given:
            raise FlagError(
                f"{plant} needs an option", where=FLAG, value=parameter.name, remedy=f"add {parameter.name}=VALUE"
            )
    return {name: _value(name, value, _kind(named.get(name))) for name, value in given.items()}


def _parameters(factory: Callable[..., Any]) -> list[Parameter]:
    """Return the parameters behind the seed; none of a factory that Python cannot describe."""
    try:
        return list(inspect.signature(factory).parameters.values())[1:]
    except (TypeError, ValueError):
        return []


def _unknown(name: str, known: list[str], plant: str) -> FlagError:
    close = difflib.get_close_matches(name, known, n=1)
    return FlagError(
        f"not an option of {plant}", where=FLAG, value=repr(name), limit=OneOf(known) if known else "it has none",
        remedy=f"did you mean '{close[0]}'?" if close else "leave it out",
    )  # fmt: skip


def _kind(parameter: Parameter | None) -> type | None:
    """Return the type that a parameter declares; None where it declares none that a command line can give."""
    if parameter is None:
        return None
    said = parameter.annotation
    names = [str(said)] if isinstance(said, str) else [getattr(said, "__name__", "")]
    if isinstance(said, types.UnionType):
        names = [getattr(one, "__name__", "") for one in get_args(said)]
    named = [part.strip() for name in names for part in name.split("|")]
    found = [_KINDS[name] for name in named if name in _KINDS]
    if found:
        return found[0]
    return type(parameter.default) if type(parameter.default) in _KINDS.values() else None


def _value(name: str, given: str | float, kind: type | None) -> Any:
    text = str(given)
    if kind is str:
        return text
    if kind is bool:
        return _read(name, text, lambda word: _TRUTHS[word.lower()], "true or false")
    if kind is int:
        return _read(name, text, int, "a whole number")
    if kind is float:
        return _read(name, text, _finite, "a number")
    try:
        return _finite(text)
    except ValueError:
        return text


def _read(name: str, text: str, read: Callable[[str], Any], limit: str) -> Any:
    try:
        return read(text)
    except (ValueError, KeyError):
        raise FlagError(f"{name} cannot have this value", where=FLAG, value=repr(text), limit=limit) from None


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value
