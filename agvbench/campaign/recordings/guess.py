"""Guess the mapping of a recording from the names and the numbers of its columns.

What a column is follows from its name; its unit from the name, or from what vehicles do: frames come 4 to 2000 times a
second, vehicles drive at most 20 m/s, and a heading follows the direction of travel. What no column tells, such as the
distances of the axles, is marked with ``# ?`` in the text.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agvbench.campaign.recordings.guess_channels import guess_channels, questions_about
from agvbench.campaign.recordings.mapping import ANGLE, LENGTH, TIME
from agvbench.campaign.tables.csv_text import read_csv_text
from agvbench.errors import FileError, OneOf
from agvbench.types import Floats
from agvbench.vehicle.channel_tables import channel_names

_DELIMITERS = ",;\t|"
_LONGEST_STEP_S, _SHORTEST_STEP_S = 0.5, 5e-4
_FASTEST_MPS = 20.0
_MOVING_SHARE = 0.2
_MARGIN = 1.5
_EPOCH_S = 1e8
# Limits that no recording exceeds [m/s, rad/s; Hz]: a wrong unit must not make a mapping that cannot be read.
_LARGEST, _HIGHEST_HZ = 100.0, 1e5
_SUFFIXES = {"time": ("s", "ms", "us", "ns"), "length": ("m", "cm", "mm"), "angle": ("rad", "deg", "mrad")}
_FACTORS = {**TIME, **LENGTH, **ANGLE}
_MEASURED = re.compile(r"est|meas|imu|odo|actual|encoder|sensor|fit")
_NAMES = {
    "time": r"\bt\b|time|stamp|epoch|sec\b",
    "x": r"\bx\b|\bpos(ition)? ?x\b|\bx pos",
    "y": r"\by\b|\bpos(ition)? ?y\b|\by pos",
    "heading": r"heading|yaw\b|theta|psi\b|orientation",
    "drive": r"throttle|drive|motor|\bcmd v\b|\bv cmd\b|cmd speed|speed cmd|linear",
    "front": r"steer|front|delta|\bcmd w\b|\bw cmd\b|cmd yaw|omega cmd|cmd omega|angular",
    "rear": r"\brear\b",
    "driven": r"arm|enable|auto|active|safety|dead ?man",
    "tracked": r"track|valid|seen|visible|pose new",
}
_TURNS = re.compile(r"cmd w|w cmd|omega|angular|yaw")


@dataclass
class _Columns:
    """The numbers of a recording, and what was taken for what; ``taken`` are columns that have a role."""

    path: Path
    numbers: Mapping[str, Floats]
    taken: dict[str, str] = field(default_factory=dict)
    questions: list[str] = field(default_factory=list)

    def take(self, role: str, among: Iterable[str] | None = None) -> str | None:
        """Return the free column whose name fits `role` best: an exact name first, a measured quantity last."""
        pattern = re.compile(_NAMES[role])
        free = [name for name in (self.numbers if among is None else among) if name not in self.taken.values()]
        fitting = [name for name in free if pattern.search(_plain(name))]
        if not fitting:
            return None
        best = min(fitting, key=lambda name: (bool(_MEASURED.search(_plain(name))), free.index(name)))
        self.taken[role] = best
        return best

    def need(self, role: str) -> str:
        """Return the column of `role`; raise `FileError` if there is none."""
        if (found := self.take(role)) is None:
            raise FileError(
                f"no column looks like {role}",
                where=self.path,
                limit=OneOf(self.numbers),
                remedy="write the mapping by hand (docs/how-to/import-your-csv.md)",
            )
        return found


def guess_mapping(path: Path | str) -> tuple[str, list[str]]:
    """Return the text of a mapping for a recording, and what it leaves to answer, one line each.

    Raises
    ------
    FileError
        If the file cannot be read, or no column looks like time, position, heading or a command.
    """
    path = Path(path)
    delimiter = _delimiter(path)
    columns = _Columns(path, _numbers(path, delimiter))
    lines = [
        f"# A guess from {path.name}: check every line, and answer those with a question mark.",
        "schema = 1",
        f'name = "{_word(path.stem)}"',
        *([] if delimiter == "," else ["", "[csv]", f'delimiter = "{delimiter}"'.replace("\t", "\\t")]),
    ]
    pose, motion = _pose(columns)
    commands = _commands(columns)
    fastest, turning, rate_hz = _limits(*motion)
    vehicle, channels = _vehicle(columns)
    for table, own in {
        "vehicle": vehicle,
        **channels,
        "mocap": [f"rate_hz = {rate_hz:.4g}"],
        "prediction": ["horizon_s = 2.0", "stride_s = 1.0"],
        "columns": pose + commands,
        "gate": [f"max_speed_m_per_s = {fastest:.3g}", f"max_yaw_rate_rad_per_s = {turning:.3g}"],
        "runs": [f"gap_s = {max(0.25, 5.0 / rate_hz):.3g}", "shortest_s = 2.0", "longest_s = 20.0"],
    }.items():
        lines += ["", f"[{table}]", *own]
    return "\n".join(lines) + "\n", columns.questions


def _pose(columns: _Columns) -> tuple[list[str], tuple[Floats, Floats, Floats]]:
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


def _commands(columns: _Columns) -> list[str]:
    """Return the lines of the commands, and of what says which rows count."""
    names = {role: columns.need(role) for role in ("drive", "front")}
    names |= {role: name for role in ("rear", "driven", "tracked") if (name := columns.take(role))}
    return [
        line
        for role, name in names.items()
        for line in (
            _flag(columns, role, name) if role in ("driven", "tracked") else [f'{role} = {{ column = "{name}" }}']
        )
    ]


def _plain(name: str) -> str:
    """Return a column's name in lower case, with spaces for what separates words, less its unit."""
    words = re.sub(r"[^a-z0-9]+", " ", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()).strip()
    return re.sub(r" (s|ms|us|ns|m|cm|mm|rad|deg|mrad)$", "", words)


def _word(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9_-]+", "_", text) or "recording"


def _delimiter(path: Path) -> str:
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            header = file.readline(1 << 16)
    except OSError as error:
        raise FileError(f"cannot be read ({error.strerror})", where=path, remedy="give a CSV recording") from None
    return max(_DELIMITERS, key=header.count)


def _numbers(path: Path, delimiter: str) -> dict[str, Floats]:
    """Return the columns that are numbers; an empty cell is NaN, and true and false are 1 and 0."""
    table = read_csv_text(path, columns=(), delimiter=delimiter)
    found = {}
    for name in table.column_names:
        column = table[name]
        try:
            values = np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)
        except (TypeError, ValueError):
            continue
        if '"' not in name and "\\" not in name and np.isfinite(values).any():
            found[name] = values
    if not found or not len(next(iter(found.values()))):
        raise FileError("has no rows of numbers", where=path, remedy="give a CSV recording with a header line")
    return found


def _time(columns: _Columns) -> tuple[str, str, Floats]:
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


def _length_unit(columns: _Columns, x: str, y: str, t_s: Floats) -> str:
    if unit := _suffix(x, "length"):
        return unit
    moved, seconds = _moves(t_s, np.column_stack([columns.numbers[x], columns.numbers[y]]))
    fast = float(np.quantile(moved / seconds, 0.95)) if len(moved) else 0.0
    unit = "m" if fast <= _FASTEST_MPS else "mm"
    columns.questions.append(
        f"{x}, {y}: in {unit}? (95 % of the speeds are below {fast * _FACTORS[unit]:.3g} m/s then)"
    )
    return unit


def _moves(t_s: Floats, position: Floats) -> tuple[Floats, Floats]:
    """Return distances and times between successive different positions."""
    known = np.flatnonzero(np.isfinite(position).all(axis=1))
    fresh = known[np.r_[True, np.any(np.diff(position[known], axis=0) != 0.0, axis=1)][: len(known)]]
    seconds = np.diff(t_s[fresh])
    moved = np.hypot(*np.diff(position[fresh], axis=0).T)
    return moved[seconds > 0.0], seconds[seconds > 0.0]


def _heading(columns: _Columns, position: Floats) -> tuple[str, str, float]:
    """Return the column of the heading, its unit and its sign: those that follow the direction of travel best."""
    name = columns.need("heading")
    steps = np.diff(position, axis=0)
    length = np.hypot(*steps.T)
    moving = length > _MOVING_SHARE * np.nanmax(length, initial=0.0)
    course = np.arctan2(steps[moving, 1], steps[moving, 0])
    angle = columns.numbers[name][1:][moving]
    known = np.isfinite(course + angle)
    units = [unit] if (unit := _suffix(name, "angle")) else ["rad", "deg"]
    tried = {
        (unit, sign): _agreement(course[known] - sign * _FACTORS[unit] * angle[known])
        for unit in units
        for sign in (1.0, -1.0)
    }
    best = max(tried, key=lambda key: (round(tried[key], 2), key[1]))
    if tried[best] < _AGREES:
        columns.questions.append(f"{name}: does not follow the direction of travel; is it the vehicle's heading?")
    if best[1] < 0.0:
        columns.questions.append(f"{name}: counts clockwise, or the floor is mirrored?")
    return name, *best


_AGREES = 0.5


def _agreement(difference: Floats) -> float:
    """Return how much angles agree, modulo half a turn: a vehicle may drive backward. 1 is all, 0 none."""
    return float(abs(np.mean(np.exp(2j * difference)))) if len(difference) else 0.0


def _vehicle(columns: _Columns) -> tuple[list[str], dict[str, list[str]]]:
    """Return the lines of the vehicle, once its commands are known, and of its channels unless they are alike."""
    front = columns.taken["front"]
    is_differential = bool(_TURNS.search(_plain(front))) and "rear" not in columns.taken
    roles = ("drive", "front") if is_differential else ("drive", "front", "rear")
    names = {role: columns.taken.get(role, front) for role in roles}
    channels = guess_channels({role: columns.numbers[name] for role, name in names.items()}, is_si=is_differential)
    columns.questions += [
        f"{names[role]}: {question}" for role, question in questions_about(channels).items() if role in columns.taken
    ]
    if is_differential:
        columns.questions.append("rear_axle_m: how far is the tracked point ahead of the axle of the driven wheels?")
        axles = ['kinematics = "differential"', "rear_axle_m = 0.0  # ? from the tracked point backward to the axle"]
    else:
        columns.questions.append("front_axle_m, rear_axle_m: how far is the tracked point from both axles?")
        axles = [
            "front_axle_m = 0.15  # ? from the tracked point forward to the front axle",
            "rear_axle_m = 0.15   # ? and backward to the rear axle",
        ]
    lines = [f'name = "{_word(columns.path.stem)}"', *axles]
    if len({(channel.unit, channel.neutral) for channel in channels.values()}) == 1:
        drive = channels["drive"]
        return [*lines, f'command_unit = "{drive.unit}"', f"neutral = {drive.neutral:.1f}"], {}
    tables = channel_names("differential" if is_differential else "two_axle")
    return lines, {f"channels.{tables[role]}": channel.lines(tables[role]) for role, channel in channels.items()}


def _flag(columns: _Columns, role: str, name: str) -> list[str]:
    """Return the line of a column of zeros and ones; nothing if it has other values or one value only."""
    values = columns.numbers[name]
    if set(np.unique(values[np.isfinite(values)]).tolist()) != {0.0, 1.0}:
        return []
    columns.questions.append(f"{name}: do only rows with 1 count as {role}?")
    return [f'{role} = {{ column = "{name}", equals = 1 }}']


def _limits(t_s: Floats, position: Floats, heading_rad: Floats) -> tuple[float, float, float]:
    """Return the limits of speed and yaw rate, half as much again as nearly all of the recording, and the rate [Hz]."""
    moved, seconds = _moves(t_s, position)
    turned = _turns(heading_rad, t_s)
    rate_hz = 1.0 / float(np.median(seconds)) if len(seconds) else 1.0
    fastest = _MARGIN * float(np.quantile(moved / seconds, 0.999)) if len(moved) else 1.0
    turning = _MARGIN * float(np.quantile(turned, 0.999)) if len(turned) else 1.0
    return min(max(fastest, 0.1), _LARGEST), min(max(turning, 0.5), _LARGEST), min(rate_hz, _HIGHEST_HZ)


def _turns(heading_rad: Floats, t_s: Floats) -> Floats:
    known: NDArray[np.bool_] = np.isfinite(heading_rad)
    steps = np.diff(np.unwrap(heading_rad[known]))
    seconds = np.diff(t_s[known])
    fresh = (steps != 0.0) & (seconds > 0.0)
    return np.asarray(np.abs(steps[fresh]) / seconds[fresh])
