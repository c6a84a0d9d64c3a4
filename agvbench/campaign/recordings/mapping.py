"""The mapping of ``agvbench import``: what a foreign recording's columns mean (schema 1), found, loaded and checked."""

from __future__ import annotations

import difflib
import math
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from agvbench.campaign import header
from agvbench.campaign.header import SCHEMA, CampaignHeader
from agvbench.errors import FileError, InputError, OneOf
from agvbench.text_files import read_toml
from agvbench.validation import convert
from agvbench.vehicle.quaternion import Axis

ISO_8601 = "iso8601"
_DELIMITERS = ",;\t|: /#&!~^*%$"
_SHIPPED = Path(__file__).parent / "mappings"

# Bounded, so that no product of them overflows; NaN is within no bound.
_MOST = 1e12
_Number = Annotated[float, msgspec.Meta(ge=-_MOST, le=_MOST)]
_Positive = Annotated[float, msgspec.Meta(gt=0.0, le=_MOST)]
_NotNegative = Annotated[float, msgspec.Meta(ge=0.0, le=_MOST)]


class _Strict(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """A table in which a misspelt key is an error."""


class Vehicle(header.Vehicle, forbid_unknown_fields=True, frozen=True):
    """As ``[vehicle]`` of ``campaign.toml``."""


class Mocap(header.Mocap, forbid_unknown_fields=True, frozen=True):
    """As ``[mocap]`` of ``campaign.toml``."""


class PredictionSettings(header.Prediction, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """As ``[prediction]`` of ``campaign.toml``."""

    horizon_s: _Positive
    stride_s: _Positive | None = None


class Csv(_Strict, frozen=True):
    """How the text is written."""

    delimiter: Annotated[str, msgspec.Meta(min_length=1, max_length=1)] = ","
    decimal: Literal[".", ","] = "."
    encoding: str = "utf-8"
    skip_rows: Annotated[int, msgspec.Meta(ge=0, le=10_000)] = 0


class Time(_Strict, frozen=True):
    """The capture time: ``clock`` "absolute" runs through all files, "file" starts anew in each."""

    column: str
    unit: str
    clock: Literal["file", "absolute"] = "file"


class QuantityColumn(_Strict, frozen=True):
    """A measured column: SI value = cell · unit · scale + offset; a scale of −1 mirrors."""

    column: str
    unit: str
    scale: _Number = 1.0
    offset: _Number = 0.0


class Signal(_Strict, frozen=True):
    """A command column: command = cell · scale + offset, in the unit of its channel."""

    column: str
    scale: _Number = 1.0
    offset: _Number = 0.0


class Quaternion(_Strict, frozen=True):
    """Orientation columns; the body axis that points forward, and the floor's axes among the tracker's."""

    x: str
    y: str
    z: str
    w: str
    forward: Axis = "x"
    floor_x: Axis = "x"
    floor_y: Axis = "y"


class Flag(_Strict, frozen=True):
    """True on the rows whose cell equals a value."""

    column: str
    equals: bool | int | float | str


class Columns(_Strict, frozen=True):
    """Which column is what."""

    time: Time
    x: QuantityColumn
    y: QuantityColumn
    drive: Signal | None = None
    front: Signal | None = None
    rear: Signal | None = None
    left: Signal | None = None
    right: Signal | None = None
    heading: QuantityColumn | None = None
    quaternion: Quaternion | None = None
    mean_error: QuantityColumn | None = None
    frame: str | None = None
    tracked: Flag | None = None
    driven: Flag | None = None
    cut: str | None = None


class Gate(_Strict, frozen=True):
    """What the vehicle cannot do between two frames, and how far noise may seem to carry it."""

    max_speed_m_per_s: _Positive
    max_yaw_rate_rad_per_s: _Positive
    slack_m: _NotNegative = 0.02
    slack_rad: _NotNegative = 0.1


class Runs(_Strict, frozen=True):
    """What the runs are called and where recordings are cut into them."""

    experiment: str = "free"
    trajectory: str = ""
    condition: str = ""
    firmware: str = ""
    session: Literal["file", "day", "campaign"] = "file"
    gap_s: _Positive = 0.5
    shortest_s: _NotNegative = 1.0
    longest_s: _Positive | None = None
    command_hold_s: _NotNegative | None = None


class FileRule(_Strict, frozen=True):
    """What differs for the files whose name matches; the first that matches counts."""

    match: str
    experiment: str | None = None
    trajectory: str | None = None
    condition: str | None = None
    firmware: str | None = None
    session: str | None = None


class Mapping(_Strict, frozen=True):
    """A whole mapping file."""

    schema: int
    name: str
    vehicle: Vehicle
    mocap: Mocap
    columns: Columns
    prediction: PredictionSettings | None = None
    channels: header.ChannelTables | None = None
    csv: Csv = Csv()
    gate: Gate | None = None
    runs: Runs = Runs()
    files: list[FileRule] = []

    def header(self, path: Path) -> CampaignHeader:
        """Return the campaign's head by this mapping, read from `path`; raise `CampaignError` if it is impossible."""
        return CampaignHeader.from_tables(
            path, self.name, self.vehicle, self.mocap, self.prediction, channels=self.channels
        )


def find_mapping(name: str | Path) -> Path:
    """Return the path of a mapping, a file or the name of one that ships; raise `FileError` if there is neither.

    >>> find_mapping("dart").name
    'dart.toml'
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
            limit=OneOf(map(repr, _DELIMITERS)), remedy="save the recording with one of these",
        )  # fmt: skip
    if columns.quaternion and columns.quaternion.floor_x[-1] == columns.quaternion.floor_y[-1]:
        where = f"{path}: columns.quaternion"
        raise FileError("floor_x and floor_y are one axis", where=where, remedy="give two of x, y, z")
    _check_commands(mapping, path, mapping.header(path))


def _check_commands(mapping: Mapping, path: Path, header: CampaignHeader) -> None:
    """Raise `FileError` unless the command columns are those of the vehicle's channels."""
    needed: tuple[str, ...] = ("drive", "front")
    other: tuple[str, ...] = ("left", "right")
    if header.channels.wheels is not None:
        needed, other = other, (*needed, "rear")
    for name in needed:
        if getattr(mapping.columns, name) is None:
            raise FileError(
                "a command column is missing", where=path, value=f"columns.{name}",
                remedy=f'add [columns.{name}] with column = "…"; [channels] says which commands the vehicle takes',
            )  # fmt: skip
    for name in other:
        if getattr(mapping.columns, name) is not None:
            raise FileError(
                "is no command of this vehicle", where=path, value=f"columns.{name}", limit=OneOf(needed),
                remedy=f"delete [columns.{name}], or correct [channels]",
            )  # fmt: skip


LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}
ANGLE = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "turn": 2.0 * math.pi}
TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}


def factor(unit: str, units: dict[str, float], where: object) -> float:
    """Return the factor from `unit` to SI; raise `InputError` if it is not one of `units`.

    >>> factor("mm", LENGTH, "columns.x")
    0.001
    """
    if unit in units:
        return units[unit]
    close = difflib.get_close_matches(unit.lower(), units, 1)
    remedy = f"give {close[0]}" if close else "give one of these"
    raise InputError("unit is unknown", where=where, value=repr(unit), limit=OneOf(units), remedy=remedy)
