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
from agvbench.campaign.tables.schema import LONGEST_NAME, NAMES_OF_POSES, can_name_column
from agvbench.errors import FileError, InputError, OneOf
from agvbench.text_files import read_toml
from agvbench.types import Command
from agvbench.validation import convert
from agvbench.vehicle.quaternion import Axis
from agvbench.vehicle.wheels import WheelCommand

_MOST_LOGGED = 64
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


Stamp = Literal["header", "received"]
"""The time of a message: the stamp of its header, where its type has one, or when it was recorded."""


class Source(_Strict, frozen=True):
    """Where values come from: the column of a table, or a field, with dots, of the messages of a bag's ``topic``."""

    column: str
    topic: str | None = None
    time: Stamp = "header"


class Signal(Source, frozen=True, kw_only=True):
    """A column of commands, or of what else was logged: value = cell · scale + offset, commands in their unit."""

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


class Flag(Source, frozen=True, kw_only=True):
    """True on the rows whose cell equals a value."""

    equals: bool | int | float | str


class PoseSource(_Strict, frozen=True):
    """The poses of a recording whose commands come from elsewhere: a topic of a bag, or else a TUM file.

    ``field`` is that of the pose in a message, with dots; by default that of its type. ``child_frame_id`` chooses among
    transforms. The axes are those of `Quaternion`, for the position, too.
    """

    topic: str | None = None
    field: str | None = None
    child_frame_id: str | None = None
    time: Stamp = "header"
    clock: Literal["file", "absolute"] = "file"
    forward: Axis = "x"
    floor_x: Axis = "x"
    floor_y: Axis = "y"


class Columns(_Strict, frozen=True):
    """Which column is what; time and pose are missing where ``[pose]`` says where they are."""

    drive: Signal | None = None
    front: Signal | None = None
    time: Time | None = None
    x: QuantityColumn | None = None
    y: QuantityColumn | None = None
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
    """A whole mapping file; ``logged`` are further columns by the name that they get in the campaign."""

    schema: int
    name: str
    vehicle: Vehicle
    mocap: Mocap
    columns: Columns
    logged: dict[str, Signal] = {}
    pose: PoseSource | None = None
    prediction: PredictionSettings | None = None
    channels: header.ChannelTables | None = None
    csv: Csv = Csv()
    gate: Gate | None = None
    runs: Runs = Runs()
    files: list[FileRule] = []

    @property
    def is_absolute(self) -> bool:
        """Whether one clock runs through all files."""
        source = self.pose or self.columns.time
        return source is not None and source.clock == "absolute"

    @property
    def commands(self) -> dict[str, Signal]:
        """The commands that are mapped, by role or wheel."""
        signals = {name: getattr(self.columns, name) for name in (*Command._fields, *WheelCommand._fields)}
        return {name: signal for name, signal in signals.items() if signal is not None}

    @property
    def flags(self) -> dict[str, Flag]:
        """What says which rows count, by name."""
        flags = {"driven": self.columns.driven, "tracked": self.columns.tracked}
        return {name: flag for name, flag in flags.items() if flag is not None}

    @property
    def sources(self) -> dict[str, Signal | Flag]:
        """Where commands, flags and further columns come from, by their keys in the file."""
        columns = {f"columns.{name}": source for name, source in (self.commands | self.flags).items()}
        return {**columns, **{f"logged.{name}": source for name, source in self.logged.items()}}

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
    mapping = convert(table, Mapping, where=str(path), remedy=_SEE)
    _check(mapping, path)
    return mapping


def quantities(mapping: Mapping) -> Iterator[tuple[str, QuantityColumn, dict[str, float]]]:
    """Yield each measured column that is mapped: its name, its declaration and the units it may have."""
    columns = mapping.columns
    known = {"x": LENGTH, "y": LENGTH, "heading": ANGLE, "mean_error": LENGTH}
    for name, units in known.items():
        quantity: QuantityColumn | None = getattr(columns, name)
        if quantity is not None:
            yield name, quantity, units


def _check(mapping: Mapping, path: Path) -> None:
    if mapping.schema != SCHEMA:
        remedy = "install a newer agvbench" if mapping.schema > SCHEMA else f"set schema = {SCHEMA}"
        raise FileError("schema is unknown", where=path, value=mapping.schema, limit=str(SCHEMA), remedy=remedy)
    _check_logged(mapping, path)
    _check_sources(mapping, path)
    for name, quantity, known in quantities(mapping):
        factor(quantity.unit, known, f"{path}: columns.{name}.unit")
    columns = mapping.columns
    if columns.time and columns.time.unit != ISO_8601:
        factor(columns.time.unit, {**TIME, ISO_8601: 1.0}, f"{path}: columns.time.unit")
    if mapping.csv.delimiter not in _DELIMITERS:
        raise FileError(
            "csv.delimiter cannot separate cells", where=path, value=repr(mapping.csv.delimiter),
            limit=OneOf(map(repr, _DELIMITERS)), remedy="save the recording with one of these",
        )  # fmt: skip
    for name, axes in {"columns.quaternion": columns.quaternion, "pose": mapping.pose}.items():
        if axes and axes.floor_x[-1] == axes.floor_y[-1]:
            raise FileError("floor_x and floor_y are one axis", where=f"{path}: {name}", remedy="give two of x, y, z")
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


def _check_sources(mapping: Mapping, path: Path) -> None:
    """Check that time, pose and commands have one source each: a CSV; topics of a bag; or a TUM file and a CSV."""
    columns, pose = mapping.columns, mapping.pose
    is_bag = pose is not None and pose.topic is not None
    for name in ("time", "x", "y"):
        if getattr(columns, name) is None and (pose is None or (name == "time" and not is_bag)):
            raise FileError(f"key {name!r} is missing", where=f"{path}: columns", remedy=_SEE)
    if pose is None and (columns.heading is None) == (columns.quaternion is None):
        remedy = "give one of columns.heading and columns.quaternion"
        raise FileError("heading is given twice or not at all", where=path, remedy=remedy)
    unused = ["x", "y", "heading", "quaternion", "mean_error", "frame", "cut"] + ["time"] * is_bag
    for name in unused if pose else []:
        if getattr(columns, name) is not None:
            remedy = "delete it, or [pose]"
            raise FileError(f"columns.{name} has no meaning beside [pose]", where=path, remedy=remedy)
    for key, source in mapping.sources.items():
        if is_bag and source.topic is None:
            raise FileError("key 'topic' is missing", where=f"{path}: {key}", remedy=_SEE_ROS)
        if source.topic is not None and not is_bag:
            remedy = "give pose.topic, too, or delete it"
            raise FileError("names a topic where no pose does", where=f"{path}: {key}", remedy=remedy)


def _check_logged(mapping: Mapping, path: Path) -> None:
    """Raise `FileError` if there are too many further columns, or the campaign cannot have one of such a name."""
    remedy = "give it another name"
    if len(mapping.logged) > _MOST_LOGGED:
        count, limit = len(mapping.logged), f"at most {_MOST_LOGGED}"
        raise FileError("[logged] has too many columns", where=path, value=count, limit=limit, remedy="delete some")
    for name in mapping.logged:
        if not can_name_column(name):
            limit = f"1 to {LONGEST_NAME} printable characters"
            shown = ascii(name[:LONGEST_NAME])
            raise FileError("[logged] has an unusable name", where=path, value=shown, limit=limit, remedy=remedy)
        if name in NAMES_OF_POSES:
            raise FileError("the poses have a column of this name", where=path, value=f"logged.{name}", remedy=remedy)


_SEE, _SEE_ROS = (f"see docs/how-to/{page}.md" for page in ("import-your-csv", "exchange-with-ros"))
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
