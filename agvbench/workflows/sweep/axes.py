"""Axes of a grid: an option of the bench, or a parameter that such an option gives, and the values that it takes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from agvbench.errors import FileError
from agvbench.running.configuration.settings import NAME_VALUE, BenchSettings
from agvbench.validation import suggest

MOST_VALUES = 1_000_000
_RANGE = re.compile(r"([+-]?[0-9]{1,18})\.\.([+-]?[0-9]{1,18})")
_NOT_HERE = ("connect", "bus_config", "session")
OPTIONS = {f.name: str(f.type) for f in fields(BenchSettings) if f.metadata and f.name not in _NOT_HERE}
"""Options of the bench that a grid may set, with their types; those of a bus are a laboratory's."""
PAIRED = tuple(
    f.name for f in fields(BenchSettings) if f.metadata and f.metadata["keywords"].get("metavar") == NAME_VALUE
)
"""Options that are parameters by name: tables in a grid."""
JOINED = tuple(f.name for f in fields(BenchSettings) if f.metadata and f.metadata["joined"])
_ALLOWED: Mapping[str, tuple[str, Callable[[Any], bool]]] = {
    "int": ("a whole number", lambda v: isinstance(v, int) and not isinstance(v, bool)),
    "float": ("a number", lambda v: isinstance(v, int | float) and not isinstance(v, bool)),
    "bool": ("true or false", lambda v: isinstance(v, bool)),
    "str": ("text", lambda v: isinstance(v, str)),
}


@dataclass(frozen=True)
class Axis:
    """An axis: the option, the parameter that it gives ("" for the option itself), and the values (at least one)."""

    option: str
    parameter: str
    values: Sequence[Any]

    @property
    def name(self) -> str:
        """What columns and messages call it.

        >>> Axis("plant_option", "backlash_m", (0.0, 0.01)).name
        'plant_option.backlash_m'
        """
        return f"{self.option}.{self.parameter}" if self.parameter else self.option

    def given(self, value: Any) -> str:
        """Return a value as the option takes it from a table: ``"NAME=VALUE"`` of a parameter."""
        return f"{self.parameter}={as_text(value)}"


def axes_of(table: Mapping[str, Any], where: str) -> Iterator[Axis]:
    """Yield the axes of the table ``[grid]``, in its order.

    Raises
    ------
    FileError
        If an option is unknown, or a value is not of its type.
    """
    for option, values in table.items():
        require_option(option, f"{where}: {option}")
        if isinstance(values, dict) and option in PAIRED:
            for parameter, inner in values.items():
                place = f"{where}.{option}: {parameter}"
                yield Axis(option, _parameter_name(parameter, place), _values(inner, "", place))
        else:
            yield Axis(option, "", _values(values, OPTIONS[option], f"{where}: {option}"))


def fixed_options(table: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the options of the table ``[fixed]`` as the bench takes them.

    Raises
    ------
    FileError
        If an option is unknown, or its value is not of its type.
    """
    found: dict[str, Any] = {}
    for option, value in table.items():
        place = f"{where}: {option}"
        require_option(option, place)
        if isinstance(value, dict) and option in PAIRED:
            pairs = [
                (_parameter_name(name, place), _checked(one, "", f"{place}.{name}")) for name, one in value.items()
            ]
            found[option] = ",".join(f"{name}={as_text(one)}" for name, one in pairs)
        elif isinstance(value, list) and option in JOINED:
            found[option] = ",".join(_checked(one, "str", place) for one in value)
        else:
            found[option] = _checked(value, OPTIONS[option], place)
    return found


def require_option(option: str, where: str) -> None:
    """Raise `FileError` unless a grid may set this option of the bench."""
    if option in _NOT_HERE:
        raise FileError("is not for a sweep, whose vehicles are simulated", where=where, remedy="leave it out")
    if option not in OPTIONS:
        raise FileError("no such option of the bench", where=where, remedy=suggest(option, list(OPTIONS)))


def as_text(value: Any) -> str:
    """Return a value of a parameter as a command line has it.

    >>> as_text(True), as_text(0.1), as_text(3)
    ('true', '0.1', '3')
    """
    return str(value).lower() if isinstance(value, bool) else str(value)


def _parameter_name(name: str, where: str) -> str:
    if not name.isidentifier():
        raise FileError("is not the name of a parameter", where=where, value=repr(name))
    return name


def _values(given: Any, kind: str, where: str) -> Sequence[Any]:
    """Return the values of an axis; `kind` is the type of the option, "" for a parameter of another part."""
    entries = given if isinstance(given, list) else [given]
    if not isinstance(given, list) and _range_of(given, kind, where) is None:
        raise FileError("value cannot be used", where=where, value=repr(given), limit="a list, or a range as 1..20")
    parts = [_range_of(one, kind, where) or (_checked(one, kind, where),) for one in entries]
    count = sum(map(len, parts))
    if not 0 < count <= MOST_VALUES:
        raise FileError("has too many values or none", where=where, value=count, limit=f"1 to {MOST_VALUES}")
    values = parts[0] if len(parts) == 1 else tuple(one for part in parts for one in part)
    if not isinstance(values, range) and len(set(map(as_text, values))) < count:
        raise FileError("has a value twice", where=where, remedy="leave it out")
    return values


def _range_of(text: Any, kind: str, where: str) -> range | None:
    """Return the whole numbers of ``"1..20"``, both ends included; None where it is no range."""
    found = _RANGE.fullmatch(text) if isinstance(text, str) and kind in ("int", "") else None
    if found is None:
        return None
    low, high = int(found[1]), int(found[2])
    if not 0 <= high - low < MOST_VALUES:
        raise FileError("range cannot be used", where=where, value=text, limit=f"1 to {MOST_VALUES} values, rising")
    return range(low, high + 1)


def _checked(value: Any, kind: str, where: str) -> Any:
    if kind:
        what, is_one = _ALLOWED[kind]
    else:
        what, is_one = "a number, true, false, or text without commas", _is_plain
    if not is_one(value):
        raise FileError("value cannot be used", where=where, value=repr(value)[:60], limit=what)
    return float(value) if kind == "float" else value


def _is_plain(value: Any) -> bool:
    return isinstance(value, int | float) or (isinstance(value, str) and bool(value) and "," not in value)
