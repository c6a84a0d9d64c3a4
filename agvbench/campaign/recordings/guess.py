"""Guess the mapping of a recording from the names and the numbers of its columns.

What a column is follows from its name; its unit from the name, or from what vehicles do: frames come 4 to 2000 times a
second, vehicles drive at most 20 m/s, and a heading follows the direction of travel. What no column tells, such as the
distances of the axles, is marked with ``# ?`` in the text.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pyarrow as pa

from agvbench.campaign.recordings.bags.bag import is_bag
from agvbench.campaign.recordings.guess_bag import guess_bag_mapping
from agvbench.campaign.recordings.guess_columns import AGREES, Columns, Motion, agreement, courses, mapping_text, moves
from agvbench.campaign.recordings.mapping import ANGLE, LENGTH, TIME, Csv, PoseSource
from agvbench.campaign.recordings.tum_recording import commands_beside, read_tum
from agvbench.campaign.tables.csv_text import read_csv_text
from agvbench.errors import FileError, OneOf
from agvbench.types import Floats

_DELIMITERS = ",;\t|"
_LINES = 50
_LONGEST_STEP_S, _SHORTEST_STEP_S = 0.5, 5e-4
_FASTEST_MPS = 20.0
_EPOCH_S = 1e8
_SUFFIXES = {"time": ("s", "ms", "us", "ns"), "length": ("m", "cm", "mm"), "angle": ("rad", "deg", "mrad")}
_FACTORS = {**TIME, **LENGTH, **ANGLE}


def guess_mapping(path: Path | str) -> tuple[str, list[str]]:
    """Return the text of a mapping for a recording, and what it leaves to answer, one line each.

    Raises
    ------
    FileError
        If the file cannot be read, or no column or topic looks like time, position, heading or a command.
    """
    path = Path(path)
    if is_bag(path):
        return guess_bag_mapping(path)
    if path.suffix == ".tum":
        return _guess_tum(path)
    csv = _csv_of(path)
    columns = _columns(path, path, csv)
    pose, motion = _pose(columns)
    return mapping_text(columns, [], _csv_table(csv), pose, motion), columns.questions


def _guess_tum(path: Path) -> tuple[str, list[str]]:
    """Return the mapping of a TUM file and of the CSV of its commands."""
    poses, beside = read_tum(path, PoseSource()), commands_beside(path)
    csv = _csv_of(beside)
    columns = _columns(path, beside, csv)
    time, unit, _ = _time(columns)
    is_absolute = poses.t_s[0] > _EPOCH_S
    tables = _csv_table(csv) | {"pose": [f'clock = "{"absolute" if is_absolute else "file"}"']}
    motion = (poses.t_s, np.column_stack([poses.x_m, poses.y_m]), poses.heading_rad)
    pose = [f'time = {{ column = "{time}", unit = "{unit}" }}']
    return mapping_text(columns, [], tables, pose, motion), columns.questions


def _csv_table(csv: Csv) -> dict[str, list[str]]:
    """Return the table of what is not as usual."""
    lines = [f'delimiter = "{csv.delimiter}"'.replace("\t", "\\t")] if csv.delimiter != "," else []
    lines += [f'decimal = "{csv.decimal}"'] if csv.decimal != "." else []
    return {"csv": lines} if lines else {}


def _pose(columns: Columns) -> tuple[list[str], Motion]:
    """Return the lines of time and pose; with times [s], positions (n, 2) [m] and headings [rad]."""
    time, time_unit, t_s = _time(columns)
    x, y = (columns.need(role) for role in ("x", "y"))
    length = _length_unit(columns, x, y, t_s)
    position = _FACTORS[length] * np.column_stack([columns.numbers[x], columns.numbers[y]])
    heading, angle, sign = _heading(columns, position)
    clock = ', clock = "absolute"' if t_s[0] > _EPOCH_S else ""
    lines = [
        f'time = {{ column = "{time}", unit = "{time_unit}"{clock} }}',
        f'x = {{ column = "{x}", unit = "{length}" }}',
        f'y = {{ column = "{y}", unit = "{length}" }}',
        f'heading = {{ column = "{heading}", unit = "{angle}"{"" if sign > 0.0 else ", scale = -1.0"} }}',
    ]
    return lines, (t_s, position, sign * _FACTORS[angle] * columns.numbers[heading])


def _csv_of(path: Path) -> Csv:
    """Return how a CSV is written, as its first lines show: between other delimiters a comma is a decimal one."""
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            header, *rows = [file.readline(1 << 16) for _ in range(_LINES)]
    except OSError as error:
        raise FileError(f"cannot be read ({error.strerror})", where=path, remedy="give a CSV recording") from None
    delimiter = max(_DELIMITERS, key=header.count)
    has_comma = delimiter != "," and any(re.search(r"\d,\d", row) for row in rows)
    return Csv(delimiter=delimiter, decimal="," if has_comma else ".")


def _columns(path: Path, values: Path, csv: Csv) -> Columns:
    """Return the columns of a recording that are numbers, from the file of its values.

    An empty cell is NaN, and true and false are 1 and 0.
    """
    table = read_csv_text(values, columns=(), delimiter=csv.delimiter, decimal=csv.decimal)
    logical = frozenset(name for name in table.column_names if pa.types.is_boolean(table[name].type))
    dates = frozenset(name for name in table.column_names if pa.types.is_temporal(table[name].type))
    found = {}
    for name in table.column_names:
        column = table[name]
        try:
            own = np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)
        except (TypeError, ValueError):
            continue
        if '"' not in name and "\\" not in name and name.isprintable() and np.isfinite(own).any():
            found[name] = own
    if not found or not len(next(iter(found.values()))):
        raise FileError("has no rows of numbers", where=values, remedy="give a CSV recording with a header line")
    return Columns(path, found, logical=logical, dates=dates)


def _time(columns: Columns) -> tuple[str, str, Floats]:
    rising = [name for name, v in columns.numbers.items() if np.all(np.diff(v) >= 0.0) and np.ptp(v) > 0.0]
    name = columns.take("time", rising)
    if name is None:
        raise FileError(
            "no column looks like a time that rises",
            where=columns.path,
            limit=OneOf(columns.numbers),
            remedy="sort the rows by time, or write the mapping by hand (docs/how-to/import-your-csv.md)",
        )
    steps = np.diff(columns.numbers[name])
    step = float(np.median(steps[steps > 0.0]))
    unit = _suffix(name, "time") or next(
        (u for u in _SUFFIXES["time"] if _SHORTEST_STEP_S <= step * _FACTORS[u] <= _LONGEST_STEP_S), "s"
    )
    return name, unit, _FACTORS[unit] * columns.numbers[name]


def _suffix(name: str, kind: str) -> str | None:
    """Return the unit at the end of a column's name."""
    last = re.split(r"[^A-Za-zµ]+", name.strip(" )]"))[-1].lower()
    return last if last in _SUFFIXES[kind] else None


def _length_unit(columns: Columns, x: str, y: str, t_s: Floats) -> str:
    if unit := _suffix(x, "length"):
        return unit
    moved, seconds = moves(t_s, np.column_stack([columns.numbers[x], columns.numbers[y]]))
    fast = float(np.quantile(moved / seconds, 0.95)) if len(moved) else 0.0
    unit = "m" if fast <= _FASTEST_MPS else "mm"
    columns.questions.append(
        f"{x}, {y}: in {unit}? (95 % of the speeds are below {fast * _FACTORS[unit]:.3g} m/s then)"
    )
    return unit


def _heading(columns: Columns, position: Floats) -> tuple[str, str, float]:
    """Return the column of the heading, its unit and its sign: those that follow the direction of travel best."""
    name = columns.need("heading")
    moving, course = courses(position)
    angle = columns.numbers[name][1:][moving]
    known = np.isfinite(course + angle)
    units = [unit] if (unit := _suffix(name, "angle")) else ["rad", "deg"]
    tried = {
        (unit, sign): agreement(course[known] - sign * _FACTORS[unit] * angle[known])
        for unit in units
        for sign in (1.0, -1.0)
    }
    best = max(tried, key=lambda key: (round(tried[key], 2), key[1]))
    if tried[best] < AGREES:
        columns.questions.append(f"{name}: does not follow the direction of travel; is it the vehicle's heading?")
    if best[1] < 0.0:
        columns.questions.append(f"{name}: counts clockwise, or the floor is mirrored?")
    return name, *best
