"""Tables of TOML and JSON files as typed structures; errors say in one line which key, what value, what is allowed."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

import msgspec
from msgspec import inspect

from agvbench.errors import CampaignError, FileError, OneOf

T = TypeVar("T")

_AT = re.compile(r"(?P<what>.*?)(?: - at `\$(?P<path>.*)`)?", re.DOTALL)
_STEP = re.compile(r"\.(?P<key>[^.\[]+)|\[(?P<index>\d+)\]|\[(?P<any>\.\.\.)\]")
_LONGEST_KEY = 40
_UNKNOWN = re.compile(r"Object contains unknown field `(.*)`")
_MISSING = re.compile(r"Object missing required field `(.*)`")
_VALUE = re.compile(r"Invalid (?:enum )?value (.*)")
_EXPECTED = re.compile(r"Expected `(?P<type>[^`]*)`(?P<rest>.*)")
_PLAIN = {"float": "a number", "int": "a whole number", "str": "text", "bool": "true or false"}
_PLAIN |= {"array": "a list", "object": "a table"}


def convert(
    table: object,
    kind: type[T],
    *,
    where: str,
    error: type[FileError | CampaignError] = FileError,
    remedy: str | None = None,
) -> T:
    """Return `table`, as read from TOML or JSON, as a `kind`.

    Parameters
    ----------
    table, kind
        What was read, and the `msgspec.Struct` that it should be.
    where
        The file, for errors.
    error, remedy
        The class of errors, and what they advise.

    Raises
    ------
    FileError, or `error`
        In one line: the file, the key, its value and what is allowed.
    """
    try:
        return msgspec.convert(table, kind)
    except msgspec.ValidationError as failure:
        fields = _fields(str(failure), table, kind, where)
        advice = "; ".join(part for part in (fields.pop("remedy", None), remedy) if part)
        raise error(fields.pop("what"), **fields, remedy=advice or None) from None


def _fields(message: str, table: object, kind: type, where: str) -> dict[str, Any]:
    """Return the fields of the error for a message of msgspec."""
    match = _AT.fullmatch(message)
    what, path = (match["what"], match["path"] or "") if match else (message, "")
    steps = [step["key"] or (None if step["any"] else int(step["index"])) for step in _STEP.finditer(path)]
    value, types, keys = _descend(table, inspect.type_info(kind), steps)
    for key in keys:
        path = path.replace("[...]", f".{key}", 1)
    place = ": ".join(part for part in (where, path.removeprefix(".")) if part)
    if found := _UNKNOWN.fullmatch(what):
        return {"what": f"unknown key '{found[1]}'", "where": place, "remedy": suggest(found[1], _keys(types))}
    if found := _MISSING.fullmatch(what):
        return {"what": f"key '{found[1]}' is missing", "where": place}
    if found := _VALUE.fullmatch(what):
        return {"what": "value is not known", "where": place, "value": found[1], "limit": OneOf(_values(types))}
    if found := _EXPECTED.fullmatch(what):
        limit = _expected(found["type"], found["rest"])
        return {"what": "value cannot be used", "where": place, "value": _shown(value), "limit": limit}
    return {"what": what, "where": place}


def _descend(
    value: object, kind: inspect.Type, steps: Sequence[str | int | None]
) -> tuple[object, list[inspect.Type], list[str]]:
    """Return the value at the end of `steps`, the types that it may have there, and the keys that msgspec left out.

    It leaves out the key of a table in which any key is allowed: that step is None.
    """
    types, keys = _choices(kind, value), []
    for given in steps:
        step = given
        if step is None:
            key = step = _failing(value, types)
            keys.append((key if key.isprintable() else ascii(key))[:_LONGEST_KEY])
        value = _item(value, step)
        types = [choice for outer in types for inner in _inside(outer, step) for choice in _choices(inner, value)]
    return value, types, keys


def _failing(value: object, types: Iterable[inspect.Type]) -> str:
    """Return the first key of a table whose entry cannot be converted; an empty text if there is none."""
    inner = [kind.value_type for kind in types if isinstance(kind, inspect.DictType)]
    for kind in (kind for kind in inner if isinstance(kind, inspect.StructType)):
        for key, item in value.items() if isinstance(value, dict) else ():
            try:
                msgspec.convert(item, kind.cls)
            except msgspec.ValidationError:
                return str(key)
    return ""


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
        tag = [inspect.LiteralType((kind.tag,))] if kind.tag is not None and kind.tag_field == step else []
        return [*tag, *(field.type for field in kind.fields if field.encode_name == step)]
    if isinstance(kind, inspect.VarTupleType | inspect.ListType):
        return [kind.item_type]
    if isinstance(kind, inspect.DictType):
        return [kind.value_type]
    return []


def _keys(types: Iterable[inspect.Type]) -> list[str]:
    structs = [kind for kind in types if isinstance(kind, inspect.StructType)]
    tags = [kind.tag_field for kind in structs if kind.tag_field]
    return list(dict.fromkeys(tags + [field.encode_name for kind in structs for field in kind.fields]))


def _values(types: Iterable[inspect.Type]) -> list[str]:
    return [str(value) for kind in types if isinstance(kind, inspect.LiteralType) for value in kind.values]


def suggest(key: str, known: list[str]) -> str:
    """Return a remedy for a misspelt `key`: the one that was probably meant, and all that are known."""
    near = difflib.get_close_matches(key, known, n=1)
    return (f"did you mean '{near[0]}'? " if near else "") + f"known: {', '.join(known)}"


def _expected(kind: str, rest: str) -> str:
    """Return "a number > 0" from "Expected `float` > 0.0" and "a number" from "Expected `float`, got `str`"."""
    names = [_PLAIN.get(name, name) for name in kind.split(" | ") if name != "null"]
    bound = "" if rest.startswith(", got") else rest.replace(".0", "")
    bound = bound.replace(" of length >= 1", " of at least one")
    return " or ".join(dict.fromkeys(names)) + bound


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
