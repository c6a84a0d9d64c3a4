"""Validation errors of trajectories: one line that says which key, what value, and what would be allowed."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Sequence
from typing import TypeVar

import msgspec
from msgspec import inspect

from agvbench.errors import FileError

T = TypeVar("T")

_AT = re.compile(r"(?P<what>.*?)(?: - at `\$(?P<path>.*)`)?", re.DOTALL)
_STEP = re.compile(r"\.(?P<key>[^.\[]+)|\[(?P<index>\d+)\]")
_UNKNOWN = re.compile(r"Object contains unknown field `(.*)`")
_MISSING = re.compile(r"Object missing required field `(.*)`")
_VALUE = re.compile(r"Invalid (?:enum )?value (.*)")
_EXPECTED = re.compile(r"Expected `(?P<type>[^`]*)`(?P<rest>.*)")
_PLAIN = {"float": "a number", "int": "a whole number", "str": "text", "bool": "true or false"}
_PLAIN |= {"array": "a list", "object": "a table"}


def convert(table: object, kind: type[T], *, where: str) -> T:
    """Return `table`, as read from TOML or JSON, as a `kind`.

    Raises
    ------
    FileError
        In one line: the file, the key, its value and what is allowed.
    """
    try:
        return msgspec.convert(table, kind)
    except msgspec.ValidationError as error:
        raise _explained(str(error), table, kind, where) from None


def _explained(message: str, table: object, kind: type, where: str) -> FileError:
    match = _AT.fullmatch(message)
    what, path = (match["what"], match["path"] or "") if match else (message, "")
    steps: list[str | int] = [step["key"] or int(step["index"]) for step in _STEP.finditer(path)]
    place = ": ".join(part for part in (where, path.removeprefix(".")) if part)
    value, types = _descend(table, inspect.type_info(kind), steps)
    if found := _UNKNOWN.fullmatch(what):
        return FileError(f"unknown key '{found[1]}'", where=place, remedy=suggest(found[1], _keys(types)))
    if found := _MISSING.fullmatch(what):
        return FileError(f"key '{found[1]}' is missing", where=place)
    if found := _VALUE.fullmatch(what):
        return FileError("value is not known", where=place, value=found[1], limit=_either(_values(types, steps)))
    if found := _EXPECTED.fullmatch(what):
        return FileError(
            "value cannot be used", where=place, value=_shown(value), limit=_expected(found["type"], found["rest"])
        )
    return FileError(what, where=place)


def _descend(value: object, kind: inspect.Type, steps: Sequence[str | int]) -> tuple[object, list[inspect.Type]]:
    """Return the value at the end of `steps`, and the types that it may have there."""
    types = _choices(kind, value)
    for step in steps:
        value = _item(value, step)
        types = [choice for outer in types for inner in _inside(outer, step) for choice in _choices(inner, value)]
    return value, types


def _item(value: object, step: str | int) -> object:
    if isinstance(value, dict):
        return value.get(step)
    return value[step] if isinstance(value, (list, tuple)) and isinstance(step, int) else None


def _choices(kind: inspect.Type, value: object) -> list[inspect.Type]:
    """Return the members of a union; of tagged structs only the one that `value` names, if it names one."""
    members = list(kind.types) if isinstance(kind, inspect.UnionType) else [kind]
    if isinstance(value, dict):
        tagged = [m for m in members if isinstance(m, inspect.StructType) and value.get(m.tag_field) == m.tag]
        return [m for m in tagged if m.tag is not None] or members
    return members


def _inside(kind: inspect.Type, step: str | int) -> Iterable[inspect.Type]:
    if isinstance(kind, inspect.StructType):
        return [field.type for field in kind.fields if field.encode_name == step]
    if isinstance(kind, inspect.VarTupleType | inspect.ListType):
        return [kind.item_type]
    return []


def _keys(types: Iterable[inspect.Type]) -> list[str]:
    structs = [kind for kind in types if isinstance(kind, inspect.StructType)]
    tags = [kind.tag_field for kind in structs if kind.tag_field]
    return list(dict.fromkeys(tags + [field.encode_name for kind in structs for field in kind.fields]))


def _values(types: Iterable[inspect.Type], steps: Sequence[str | int]) -> list[str]:
    values = [str(value) for kind in types if isinstance(kind, inspect.LiteralType) for value in kind.values]
    # A wrong tag has no type of its own; there is one tagged union in a trajectory.
    return values or (["straight", "arc", "pause"] if steps and steps[-1] == "kind" else [])


def suggest(key: str, known: list[str]) -> str:
    """Return a remedy for a misspelt `key`: the one that was probably meant, and all that are known."""
    near = difflib.get_close_matches(key, known, n=1)
    return (f"did you mean '{near[0]}'? " if near else "") + f"known: {', '.join(known)}"


def _either(values: list[str]) -> str:
    return ", ".join(values[:-1]) + " or " + values[-1] if len(values) > 1 else "".join(values)


def _expected(kind: str, rest: str) -> str:
    """Return "a number > 0" from "Expected `float` > 0.0" and "a number" from "Expected `float`, got `str`"."""
    names = [_PLAIN.get(name, name) for name in kind.split(" | ") if name != "null"]
    bound = "" if rest.startswith(", got") else rest.replace(".0", "")
    bound = bound.replace(" of length >= 1", " of at least one")
    return " or ".join(dict.fromkeys(names)) + bound


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
