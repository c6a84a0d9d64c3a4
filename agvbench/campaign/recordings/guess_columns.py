"""What guesses of mappings share: which column has which role, and what its numbers say of vehicle and limits."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agvbench.campaign.recordings.guess_channels import guess_channels, questions_about, stated_scale
from agvbench.errors import FileError, OneOf
from agvbench.types import Floats
from agvbench.vehicle.channel_tables import channel_names
from agvbench.vehicle.channels import ROLES

_MOVING_SHARE = 0.2
_MARGIN = 1.5
# Limits that no recording exceeds [m/s, rad/s; Hz]: a wrong unit must not make a mapping that cannot be read.
_LARGEST, _HIGHEST_HZ = 100.0, 1e5
MEASURED = re.compile(r"est|meas|imu|odo|actual|encoder|sensor|fit")
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
# What may change how fast a vehicle drives; a current or a power is a consequence of how it drives.
_SUPPLY = re.compile(r"batt|volt|supply|temperature")
_CONSEQUENCE = re.compile(r"current|power|amp|watt|\b[aw]\b")
_NO_COMMAND = re.compile(r"batt|temperature")
_MOST_LOGGED, _LONGEST_KEY = 16, 40


@dataclass
class Columns:
    """The numbers of a recording, and what was taken for what; ``taken`` are columns that have a role.

    ``keys`` are the keys of the mapping that name a column, where they are not ``column = "NAME"``; ``is_si`` says that
    commands are in SI units; ``logical`` are the columns of true and false, and ``dates`` those of dates.
    """

    path: Path
    numbers: Mapping[str, Floats]
    keys: Mapping[str, str] = field(default_factory=dict)
    is_si: bool = False
    logical: frozenset[str] = frozenset()
    dates: frozenset[str] = frozenset()
    taken: dict[str, str] = field(default_factory=dict)
    questions: list[str] = field(default_factory=list)

    def take(self, role: str, among: Iterable[str] | None = None) -> str | None:
        """Return the free column whose name fits `role` best: an exact name first, a measured quantity last."""
        pattern = re.compile(_NAMES[role])
        free = [name for name in (self.numbers if among is None else among) if name not in self.taken.values()]
        fitting = [name for name in free if pattern.search(plain(name))]
        if role in ROLES:
            fitting = [name for name in fitting if not _NO_COMMAND.search(plain(name))]
        if not fitting:
            return None
        best = min(fitting, key=lambda name: (bool(MEASURED.search(plain(name))), free.index(name)))
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

    def key(self, name: str) -> str:
        """Return the keys that name a column in a mapping."""
        return self.keys.get(name, f'column = "{name}"')


def plain(name: str) -> str:
    """Return a column's name in lower case, with spaces for what separates words, less its unit."""
    words = re.sub(r"[^a-z0-9]+", " ", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()).strip()
    return re.sub(r" (s|ms|us|ns|m|cm|mm|rad|deg|mrad)$", "", words)


def word(text: str) -> str:
    """Return `text` as a name without spaces."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", text) or "recording"


AGREES = 0.5
"""How much a heading and the direction of travel agree at least."""


def courses(position: Floats) -> tuple[NDArray[np.bool_], Floats]:
    """Return which steps (n − 1) between positions (n, 2) are long, and their directions [rad]."""
    steps = np.diff(position, axis=0)
    length = np.hypot(*steps.T)
    moving = length > _MOVING_SHARE * np.nanmax(length, initial=0.0)
    return moving, np.arctan2(steps[moving, 1], steps[moving, 0])


def agreement(difference: Floats) -> float:
    """Return how much angles agree, modulo half a turn: a vehicle may drive backward. 1 is all, 0 none."""
    return float(abs(np.mean(np.exp(2j * difference)))) if len(difference) else 0.0


Motion = tuple[Floats, Floats, Floats]
"""Times (n,) [s], positions (n, 2) [m] and headings (n,) [rad]."""


def mapping_text(
    columns: Columns, comments: Iterable[str], tables: Mapping[str, list[str]], pose: list[str], motion: Motion
) -> str:
    """Return the text of a mapping.

    Parameters
    ----------
    columns
        The columns, from which commands and flags are taken, unless they were taken before.
    comments
        Lines of comment at the top.
    tables
        Tables that say where the values are; ``columns`` follows.
    pose
        The lines of time and pose in ``columns``.
    motion
        What the limits are guessed from.
    """
    commands = _commands(columns)
    fastest, turning, rate_hz = _limits(*motion)
    vehicle, channels = _vehicle(columns)
    logged = _logged(columns)
    lines = [
        f"# A guess from {columns.path.name}: check every line, and answer those with a question mark.",
        *comments,
        "schema = 1",
        f'name = "{word(columns.path.stem)}"',
    ]
    for table, own in {
        **tables,
        "vehicle": vehicle,
        **channels,
        "mocap": [f"rate_hz = {rate_hz:.4g}"],
        "prediction": ["horizon_s = 2.0", "stride_s = 1.0"],
        "columns": pose + commands,
        **({"logged": logged} if logged else {}),
        "gate": [f"max_speed_m_per_s = {fastest:.3g}", f"max_yaw_rate_rad_per_s = {turning:.3g}"],
        "runs": [f"gap_s = {max(0.25, 5.0 / rate_hz):.3g}", "shortest_s = 2.0", "longest_s = 20.0"],
    }.items():
        lines += ["", f"[{table}]", *own]
    return "\n".join(lines) + "\n"


def _commands(columns: Columns) -> list[str]:
    """Return the lines of the commands, and of what says which rows count."""
    names = {role: columns.taken.get(role) or columns.need(role) for role in ("drive", "front")}
    names |= {role: name for role in ("rear", "driven", "tracked") if (name := columns.take(role))}
    return [
        line
        for role, name in names.items()
        for line in (_flag(columns, role, name) if role in ("driven", "tracked") else [_command(columns, role, name)])
    ]


def _logged(columns: Columns) -> list[str]:
    """Return the lines of the columns that may tell why the vehicle drives faster or slower: numbers that vary."""
    named: dict[str, str] = {}
    for name, values in columns.numbers.items():
        known = values[~np.isnan(values)]
        is_number = name not in columns.logical | columns.dates and len(known) > 0 and bool(np.isfinite(known).all())
        if not is_number or name in columns.taken.values() or not _is_supply(plain(name)) or known.min() == known.max():
            continue
        key = word(name).strip("_-")[:_LONGEST_KEY] or "supply"
        further = (f"{key}_{number}" for number in count(2))
        named[key if key not in named else next(other for other in further if other not in named)] = name
    return [f"{key} = {{ {columns.key(name)} }}" for key, name in list(named.items())[:_MOST_LOGGED]]


def _is_supply(name: str) -> bool:
    return bool(_SUPPLY.search(name)) and not _CONSEQUENCE.search(name)


def _command(columns: Columns, role: str, name: str) -> str:
    scale = stated_scale(name) or 1.0
    return f"{role} = {{ {columns.key(name)}{'' if scale == 1.0 else f', scale = {scale:.9g}'} }}"


def _vehicle(columns: Columns) -> tuple[list[str], dict[str, list[str]]]:
    """Return the lines of the vehicle, once its commands are known, and of its channels unless they are alike."""
    front = columns.taken["front"]
    is_differential = bool(_TURNS.search(plain(front))) and "rear" not in columns.taken
    roles = ("drive", "front") if is_differential else ("drive", "front", "rear")
    names = {role: columns.taken.get(role, front) for role in roles}
    scales = {role: stated_scale(name) for role, name in names.items()}
    commands = {role: (scales[role] or 1.0) * columns.numbers[name] for role, name in names.items()}
    every_si = columns.is_si or is_differential
    channels = guess_channels(commands, si=[role for role in roles if every_si or scales[role] is not None])
    questions = questions_about(channels, has_axles=not is_differential)
    columns.questions += [f"{names[role]}: {text}" for role, text in questions.items() if role in columns.taken]
    if is_differential:
        columns.questions.append("rear_axle_m: how far is the tracked point ahead of the axle of the driven wheels?")
        axles = ['kinematics = "differential"', "rear_axle_m = 0.0  # ? from the tracked point backward to the axle"]
    else:
        columns.questions.append("front_axle_m, rear_axle_m: how far is the tracked point from both axles?")
        axles = [
            "front_axle_m = 0.15  # ? from the tracked point forward to the front axle",
            "rear_axle_m = 0.15   # ? and backward to the rear axle",
        ]
    lines = [f'name = "{word(columns.path.stem)}"', *axles]
    if len({(channel.unit, channel.neutral) for channel in channels.values()}) == 1:
        drive = channels["drive"]
        return [*lines, f'command_unit = "{drive.unit}"', f"neutral = {drive.neutral:.1f}"], {}
    tables = channel_names("differential" if is_differential else "two_axle")
    return lines, {f"channels.{tables[role]}": channel.lines(tables[role]) for role, channel in channels.items()}


def _flag(columns: Columns, role: str, name: str) -> list[str]:
    """Return the line of a column of zeros and ones; nothing if it has other values or one value only."""
    values = columns.numbers[name]
    if set(np.unique(values[np.isfinite(values)]).tolist()) != {0.0, 1.0}:
        return []
    counted = "true" if name in columns.logical else "1"
    columns.questions.append(f"{name}: do only rows with {counted} count as {role}?")
    return [f"{role} = {{ {columns.key(name)}, equals = {counted} }}"]


def _limits(t_s: Floats, position: Floats, heading_rad: Floats) -> tuple[float, float, float]:
    """Return the limits of speed and yaw rate, half as much again as nearly all of the recording, and the rate [Hz]."""
    moved, seconds = moves(t_s, position)
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


def moves(t_s: Floats, position: Floats) -> tuple[Floats, Floats]:
    """Return distances and times between successive different positions."""
    known = np.flatnonzero(np.isfinite(position).all(axis=1))
    fresh = known[np.r_[True, np.any(np.diff(position[known], axis=0) != 0.0, axis=1)][: len(known)]]
    seconds = np.diff(t_s[fresh])
    moved = np.hypot(*np.diff(position[fresh], axis=0).T)
    return moved[seconds > 0.0], seconds[seconds > 0.0]
