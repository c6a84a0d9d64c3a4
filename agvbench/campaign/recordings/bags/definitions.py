"""The types of a bag's messages, from the definitions in the bag, checked before rosbags makes code of them.

rosbags compiles a decoder for each type. Only names of fields and types get into that code, and these are identifiers.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from rosbags.interfaces import Connection, MessageDefinitionFormat, Nodetype
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from agvbench.errors import FileError

MAX_ELEMENTS = 100_000
"""Of all fixed arrays in a message together: the compiled decoder has lines for each."""
MAX_SEQUENCE = 10_000_000
_MAX_DEPTH = 50
_FIELD = re.compile(r"[A-Za-z]\w*", re.ASCII)
_TYPE = re.compile(r"[A-Za-z]\w*(/[A-Za-z]\w*){1,2}", re.ASCII)
_IDL_SEPARATOR = "=" * 80 + "\n"

_NUMBERS = "steering_angle steering_angle_velocity speed acceleration jerk"
_ACKERMANN = {
    "ackermann_msgs/msg/AckermannDrive": "".join(f"float32 {name}\n" for name in _NUMBERS.split()),
    "ackermann_msgs/msg/AckermannDriveStamped": "std_msgs/Header header\nAckermannDrive drive\n",
}
"""rosbags does not know these; bags before ROS 2 Iron contain no definitions."""

Types = dict[str, tuple[list[Any], list[tuple[str, Any]]]]
"""By type its constants and its fields, as rosbags has them."""


def typestore_for(connections: Collection[Connection], path: Path, *, is_ros1: bool) -> Typestore:
    """Return a store of the types of `connections`: by their definitions, else as the current ROS 2 (ROS 1) has them.

    Raises
    ------
    FileError
        If a type is unknown, or its definition cannot be used.
    """
    known: Types = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.LATEST).fielddefs
    for name, text in _ACKERMANN.items():
        known = known | get_types_from_msg(text, name)
    types: Types = {}
    for connection in connections:
        types |= _defined(connection)
    needed: Types = {}
    for connection in connections:
        _require(connection.msgtype, types, known, needed, path)
        _count(connection.msgtype, needed, path)
    store = get_typestore(Stores.EMPTY)
    # The code contains no constants: nothing here reads them.
    store.register({name: ([], fields) for name, (_, fields) in needed.items() if name not in store.fielddefs})
    store.max_sequence_length = MAX_SEQUENCE
    return store


def _defined(connection: Connection) -> Types:
    """Return the types that a connection's definition defines."""
    definition = connection.msgdef
    if definition.format == MessageDefinitionFormat.MSG:
        return get_types_from_msg(definition.data, connection.msgtype)
    types: Types = {}
    if definition.format == MessageDefinitionFormat.IDL:
        for part in definition.data.split(_IDL_SEPARATOR):
            text = part.partition("\n")[2] if part.startswith("IDL: ") else part
            if text.strip():
                types |= get_types_from_idl(text)
    return types


def _require(name: str, types: Types, known: Types, needed: Types, path: Path) -> None:
    """Add the type `name` and those that it contains to `needed`."""
    waiting = [name]
    while waiting:
        current = waiting.pop()
        if current in needed:
            continue
        if current not in types and current not in known:
            raise FileError(
                "has no definition of a type", where=path, value=current,
                remedy="record with a ROS 2 that stores definitions (Iron or newer), or convert the bag there",
            )  # fmt: skip
        fields = (types.get(current) or known[current])[1]
        if not _TYPE.fullmatch(current) or not all(_FIELD.fullmatch(field) for field, _ in fields):
            raise FileError("has a type with names that are none", where=path, value=repr(current)[:80])
        needed[current] = ([], fields)
        waiting += [part for _, description in fields if (part := _contained(description))]


def _contained(description: Any) -> str | None:
    """Return the type that a field has, or the items of which have; None if that is a number or a text."""
    kind, content = description
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        kind, content = content[0]
    return str(content) if kind == Nodetype.NAME else None


def _count(name: str, types: Mapping[str, tuple[list[Any], list[tuple[str, Any]]]], path: Path) -> None:
    """Refuse a type that contains itself, or more than `MAX_ELEMENTS`."""

    @cache
    def elements(current: str, depth: int) -> int:
        if depth > _MAX_DEPTH:
            raise FileError("has a type that contains itself", where=path, value=name)
        total = 0
        for _, description in types[current][1]:
            length = max(1, int(description[1][1])) if description[0] == Nodetype.ARRAY else 1
            contained = _contained(description)
            total += length * (elements(contained, depth + 1) if contained else 1)
        return total

    if (found := elements(name, 0)) > MAX_ELEMENTS:
        value = f"{name}: {found} elements"
        raise FileError("has a type that is too large", where=path, value=value, limit=f"{MAX_ELEMENTS}")
