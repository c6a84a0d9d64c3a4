"""Consistency checks of a campaign's tables: each check is one question with a one-line answer.

Poses may be late, doubled, missing, untracked or wild, and headings may jump by 2π: real cameras do all of that.
What is refused is what no camera and no vehicle does: values that are not numbers, another clock, another unit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from agvbench.campaign.header import CampaignHeader
from agvbench.campaign.tables.schema import SPLITS
from agvbench.campaign.tables.timed_table import TimedTable
from agvbench.errors import CampaignError, OneOf
from agvbench.types import RUN_OK, CommandUnit, Floats, RunStatus
from agvbench.vehicle.channels import Channel
from agvbench.vehicle.wheels import WheelCommand

FIRST_COMMAND_TOLERANCE_S = 60.0
CLOCK_TOLERANCE_S = 600.0
FARTHEST_M = 500.0
WIDEST_HEADING_RAD = 100.0
_DECIMALS = 9


class _Limits(NamedTuple):
    low: float
    high: float
    remedy: str


_COMMAND_LIMITS: dict[CommandUnit, _Limits] = {
    "us": _Limits(100.0, 10_000.0, 'pulse widths are in µs; is command_unit "normalised"?'),
    "normalised": _Limits(-2.0, 2.0, 'commands are −1…1; is command_unit "us" or "si"?'),
    "si": _Limits(-100.0, 100.0, 'commands are in m/s, rad or rad/s; is command_unit "us"?'),
}


def check_runs(table: pa.Table, where: object) -> None:
    """Raise `CampaignError` if two runs share an id, or a status, split, repeat, start or target cannot be."""
    ids: list[str] = table["run_id"].to_pylist()
    _refuse_doubles(ids, where)
    for row in table.to_pylist():
        place = f"{where}: run {row['run_id']}"
        for name, good, limit, remedy in _RUN_RULES:
            if not good(row):
                value = row[name] if name != "target" else tuple(row[column] for column in _TARGET)
                raise CampaignError(f"{name} cannot be", where=place, value=repr(value), limit=limit, remedy=remedy)


_TARGET = ("target_x_m", "target_y_m", "target_heading_rad")


def _has_whole_target(row: Mapping[str, Any]) -> bool:
    values = [row[name] for name in _TARGET]
    return all(map(math.isfinite, values)) or all(map(math.isnan, values))


_RUN_RULES: tuple[tuple[str, Callable[[Mapping[str, Any]], bool], str | OneOf, str], ...] = (
    (
        "status",
        lambda row: _is_status(row["status"]),
        '"ok", "rejected: WHY" or "aborted: WHY"',
        "correct it",
    ),
    ("repeat", lambda row: row["repeat"] >= 0, "0 or more", "count repeats from 0 or 1"),
    (
        "started_s",
        lambda row: 0.0 <= row["started_s"] < math.inf,
        "0 s or more",
        "count seconds from the campaign's beginning",
    ),
    (
        "target",
        _has_whole_target,
        "three finite numbers, or three NaN where there is no target",
        "correct " + ", ".join(_TARGET),
    ),
    ("split", lambda row: (row.get("split") or "fit") in SPLITS, OneOf(SPLITS), "correct it, or leave it empty"),
)


def _refuse_doubles(ids: list[str], where: object) -> None:
    if "" in ids:
        raise CampaignError(f"row {ids.index('') + 1} has no run_id", where=where, remedy="fill in run_id")
    if len(set(ids)) < len(ids):
        double = next(run_id for run_id in ids if ids.count(run_id) > 1)
        raise CampaignError(
            "two runs have one id",
            where=f"{where}: rows {ids.index(double) + 1} and {ids.index(double, ids.index(double) + 1) + 1}",
            value=double,
            remedy="give each run its own run_id",
        )


def _is_status(text: str) -> bool:
    try:
        RunStatus.parse(text)
    except ValueError:
        return False
    return True


def check_commands(commands: TimedTable, status: list[str], header: CampaignHeader) -> None:
    """Raise `CampaignError` if the commands table contradicts the runs or the head.

    A run that counts has commands; all are finite and within their channel, and their time increases from about 0.
    """
    _refuse_runs_without(commands, status)
    names = header.command_columns
    for column, name in {"t_s": "t_s", **names}.items():
        values = commands.column(column)
        _refuse(commands, ~np.isfinite(values), f"{name} is not a finite number", values, remedy="correct it")
    for name, channel, values in _named_channels(commands, header):
        low, high, remedy = _command_limits(channel, name)
        outside = (values < low) | (values > high)
        _refuse(commands, outside, f"{name} is out of range", values, f"{low:g}…{high:g}", remedy)
    t_s = commands.column("t_s")
    still = np.r_[False, np.diff(t_s) <= 0.0]
    still[commands.starts] = False
    _refuse(commands, still, "t_s does not increase", t_s, remedy="order the commands by t_s, one row for each time")
    late = np.zeros(len(t_s), np.bool_)
    late[commands.starts] = np.abs(t_s[commands.starts]) > FIRST_COMMAND_TOLERANCE_S
    remedy = "t_s counts from the first command: shift the run's commands and poses"
    limit = f"within {FIRST_COMMAND_TOLERANCE_S:g} s of 0"
    _refuse(commands, late, "t_s of the first command is not 0", t_s, limit, remedy)


def _named_channels(commands: TimedTable, header: CampaignHeader) -> list[tuple[str, Channel, Floats]]:
    """Return name, channel and values (n,) of each column that the file has."""
    drive, front = commands.column("drive"), commands.column("front")
    if (wheels := header.channels.wheels) is not None:
        own = zip(WheelCommand._fields, wheels.channels, wheels.wheels(drive, front), strict=True)
        # A command at the end of the range may be beyond it by the rounding of both conversions.
        return [(name, channel, np.round(values, _DECIMALS)) for name, channel, values in own]
    roles = header.command_columns.items()
    return [(name, getattr(header.channels, role), commands.column(role)) for role, name in roles]


def _command_limits(channel: Channel, name: str) -> _Limits:
    if channel.is_bounded:
        return _Limits(channel.low, channel.high, f"correct it, or [channels.{name}] of campaign.toml")
    return _COMMAND_LIMITS[channel.unit]


def check_poses(poses: TimedTable, status: list[str], last_command_s: Floats) -> None:
    """Raise `CampaignError` if the poses table contradicts the runs.

    A run that counts has poses; what is tracked is finite, and clock and units are the campaign's. The poses are NaN
    where not tracked; `last_command_s` [s] has shape (runs,).
    """
    _refuse_runs_without(poses, status)
    t_s, tracked, heading = poses.column("t_s"), poses.column("tracked").astype(bool), poses.column("heading_rad")
    _refuse(poses, ~np.isfinite(t_s), "t_s is not a finite number", t_s, remedy="give each pose its capture time")
    end_s = last_command_s[poses.run_of_row] + CLOCK_TOLERANCE_S
    _refuse(
        poses,
        (t_s < -CLOCK_TOLERANCE_S) | (t_s > end_s),
        "t_s lies far outside the run",
        t_s,
        f"within {CLOCK_TOLERANCE_S:g} s of its commands",
        "give poses and commands one clock in seconds, 0 at the first command",
    )
    for name in ("x_m", "y_m", "heading_rad"):
        values = poses.column(name)
        _refuse(poses, tracked & np.isinf(values), f"{name} is infinite", values, remedy="set tracked to false there")
    for name in ("x_m", "y_m"):
        seen = np.abs(poses.column(name)[tracked])
        if len(seen) and (median := float(np.median(seen))) > FARTHEST_M:
            first = poses.run_of_row[tracked][int(np.argmax(seen > FARTHEST_M))]
            raise CampaignError(
                f"{name} is not in metres",
                where=f"{poses.path}: run {poses.run_ids[first]}",
                value=f"median |{name}| {median:.6g}",
                limit=f"a median within {FARTHEST_M:g} m",
                remedy="convert from mm",
            )
    _refuse(
        poses,
        _looks_like_degrees(poses, heading, tracked),
        "heading_rad looks like degrees",
        heading,
        "radians",
        "convert it to radians",
    )


def _looks_like_degrees(poses: TimedTable, heading: Floats, tracked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark runs' first headings beyond sixteen turns, and jumps by 360: radians show neither."""
    suspect = np.zeros(len(heading), np.bool_)
    suspect[poses.starts] = np.abs(heading[poses.starts]) > WIDEST_HEADING_RAD
    jump = np.abs(np.diff(heading, prepend=heading[:1]))
    jump[poses.starts] = 0.0
    around = np.abs(jump - 360.0) < 10.0
    return tracked & (suspect | around)


def _refuse_runs_without(table: TimedTable, status: list[str]) -> None:
    for run_id, state, count in zip(table.run_ids, status, table.counts, strict=True):
        if state == RUN_OK and count == 0:
            raise CampaignError(
                f"run {run_id} has none although its status is ok",
                where=table.path,
                remedy='add its rows, or set its status to "aborted: WHY"',
            )


def _refuse(
    table: TimedTable,
    bad: NDArray[np.bool_],
    what: str,
    values: Floats,
    limit: str | None = None,
    remedy: str | None = None,
) -> None:
    if bad.any():
        row = int(np.argmax(bad))
        raise CampaignError(what, where=table.place(row), value=f"{values[row]:g}", limit=limit, remedy=remedy)
