"""Find, load and check the mapping of ``agvbench import``, and convert its units to SI."""

from __future__ import annotations

import difflib
import math
import tomllib
from collections.abc import Iterator
from pathlib import Path

from agvbench.campaign.header import SCHEMA
from agvbench.campaign.recordings.mapping_schema import ISO_8601, Mapping, QuantityColumn
from agvbench.errors import FileError, InputError
from agvbench.text_files import read_toml
from agvbench.validation import convert

_DELIMITERS = ",;\t|: /#&!~^*%$"
_SHIPPED = Path(__file__).parent / "mappings"


def find_mapping(name: str | Path) -> Path:
    """Return the path of a mapping: a file, or the name of one that ships with agvbench.

    >>> find_mapping("dart").name
    'dart.toml'

    Raises
    ------
    FileError
        If there is neither.
    """
    path = Path(name)
    if path.is_file():
        return path
    shipped = _SHIPPED / f"{str(name).removesuffix('.toml')}.toml"
    if path.name == str(name) and shipped.is_file():
        return shipped
    names = ", ".join(sorted(file.stem for file in _SHIPPED.glob("*.toml")))
    raise FileError("is neither a file nor a mapping that ships", where=name, remedy=f"give a path, or one of: {names}")


def load_mapping(name: str | Path) -> Mapping:
    """Load and check a mapping, by path or shipped name.

    Raises
    ------
    FileError
        If it does not exist, is not TOML, has an unknown or missing key, or a value that cannot be used.
    """
    path = find_mapping(name)
    try:
        table = read_toml(path)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FileError(f"is not TOML ({error})", where=path, remedy="correct the line") from None
    except OSError as error:
        raise FileError(f"cannot be read ({error.strerror})", where=path, remedy="check its permissions") from None
    mapping = convert(table, Mapping, where=str(path), remedy="see docs/how-to/import-your-csv.md")
    _check(mapping, path)
    return mapping


def quantities(mapping: Mapping) -> Iterator[tuple[str, QuantityColumn, dict[str, float]]]:
    """Yield each measured column that is mapped: its name, its declaration and the units it may have."""
    columns = mapping.columns
    yield "x", columns.x, LENGTH
    yield "y", columns.y, LENGTH
    if columns.heading:
        yield "heading", columns.heading, ANGLE
    if columns.mean_error:
        yield "mean_error", columns.mean_error, LENGTH


def _check(mapping: Mapping, path: Path) -> None:
    columns = mapping.columns
    if mapping.schema != SCHEMA:
        remedy = "install a newer agvbench" if mapping.schema > SCHEMA else f"set schema = {SCHEMA}"
        raise FileError("schema is unknown", where=path, value=mapping.schema, limit=str(SCHEMA), remedy=remedy)
    if (columns.heading is None) == (columns.quaternion is None):
        remedy = "give one of columns.heading and columns.quaternion"
        raise FileError("heading is given twice or not at all", where=path, remedy=remedy)
    for name, quantity, known in quantities(mapping):
        factor(quantity.unit, known, f"{path}: columns.{name}.unit")
    if columns.time.unit != ISO_8601:
        factor(columns.time.unit, {**TIME, ISO_8601: 1.0}, f"{path}: columns.time.unit")
    if mapping.csv.delimiter not in _DELIMITERS:
        raise FileError(
            "csv.delimiter cannot separate cells", where=path, value=repr(mapping.csv.delimiter),
            limit="one of " + " ".join(map(repr, _DELIMITERS)), remedy="save the recording with one of these",
        )  # fmt: skip
    if columns.quaternion and columns.quaternion.floor_x[-1] == columns.quaternion.floor_y[-1]:
        where = f"{path}: columns.quaternion"
        raise FileError("floor_x and floor_y are one axis", where=where, remedy="give two of x, y, z")
    mapping.header(path)


LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}
ANGLE = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "turn": 2.0 * math.pi}
TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}


def factor(unit: str, units: dict[str, float], where: object) -> float:
    """Return the factor from `unit` to SI.

    >>> factor("mm", LENGTH, "columns.x")
    0.001

    Raises
    ------
    InputError
        If `unit` is not one of `units`.
    """
    if unit in units:
        return units[unit]
    close = difflib.get_close_matches(unit.lower(), units, 1)
    remedy = f"give {close[0]}" if close else "give one of these"
    raise InputError("unit is unknown", where=where, value=repr(unit), limit=", ".join(units), remedy=remedy)
