"""Command channels in files: ``command_unit`` and ``neutral`` for all of them, or a table ``[channels.NAME]`` for each.

In a table SI units have their symbols, so that a reader of the file need not know what a channel sets. A differential
vehicle has the tables ``speed`` and ``yaw_rate``, or ``left`` and ``right`` for the speeds of its wheels.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, Final

from agvbench.errors import OneOf, VehicleError
from agvbench.types import CommandUnit, Kinematics
from agvbench.vehicle.channels import Channel, Channels
from agvbench.vehicle.fields import check_keys, located, number
from agvbench.vehicle.wheels import WheelCommand, Wheels

_NAMES: Final[dict[Kinematics, dict[str, str]]] = {
    "two_axle": {"drive": "drive", "front": "front", "rear": "rear"},
    "differential": {"drive": "speed", "front": "yaw_rate"},
}
_SI_UNITS: Final = {"drive": "m/s", "speed": "m/s", "front": "rad", "rear": "rad", "yaw_rate": "rad/s"}
_LENGTHS: Final = ("track_m", "wheel_radius_m")
_KEYS: Final = ("unit", "neutral", "low", "high")


def channel_names(kinematics: Kinematics) -> Mapping[str, str]:
    """Return the names of the channels in files, by role.

    >>> dict(channel_names("differential"))
    {'drive': 'speed', 'front': 'yaw_rate'}
    """
    return _NAMES[kinematics]


def si_unit(name: str) -> str:
    """Return the SI unit of the channel of this name in files.

    >>> si_unit("yaw_rate")
    'rad/s'
    """
    return _SI_UNITS[name]


def channels_from_keys(content: Mapping[str, Any], kinematics: Kinematics) -> Channels:
    """Return the channels of a file's `content`: its key ``channels``, or ``command_unit`` and ``neutral``.

    Raises
    ------
    VehicleError
        If both are there or a key is missing, unknown or has a value that cannot be used; the line names the key.
    """
    if "channels" not in content:
        unit = content["command_unit"]
        if not isinstance(unit, str):
            raise VehicleError("must be a text", where="command_unit", value=repr(unit))
        return Channels.alike(unit, number(content["neutral"], where="neutral"))  # type: ignore[arg-type]
    for key in ("command_unit", "neutral"):
        if key in content:
            raise VehicleError(
                "the channels are described twice", where=key, limit="command_unit and neutral, or [channels]",
                remedy=f"delete {key}, or [channels]",
            )  # fmt: skip
    return _from_tables(content["channels"], kinematics)


def channels_to_keys(channels: Channels, kinematics: Kinematics) -> dict[str, Any]:
    """Return what `channels_from_keys` reads: ``command_unit`` and ``neutral`` if the channels are alike."""
    if (common := channels.common) is not None:
        return {"command_unit": common.unit, "neutral": common.neutral}
    if (wheels := channels.wheels) is not None:
        return {"channels": _wheel_tables(wheels)}
    return {
        "channels": {
            name: _to_table(getattr(channels, role), _SI_UNITS[name]) for role, name in _NAMES[kinematics].items()
        }
    }


def _from_tables(tables: object, kinematics: Kinematics) -> Channels:
    names = _NAMES[kinematics]
    if not isinstance(tables, Mapping):
        raise VehicleError("must be a table", where="channels", value=repr(tables))
    if kinematics == "differential" and any(name in tables for name in (*WheelCommand._fields, *_LENGTHS)):
        return Channels.of_wheels(_wheels(tables))
    check_keys(tables, names.values(), where="channels")
    _require_tables(tables, names.values())
    found = {role: _from_table(tables[name], name, _SI_UNITS[name]) for role, name in names.items()}
    return Channels(found["drive"], found["front"], found.get("rear", found["front"]))


def _require_tables(tables: Mapping[str, Any], names: Iterable[str]) -> None:
    for name in names:
        if name not in tables:
            raise VehicleError("a table is missing", where=f"channels.{name}", remedy=f"add [channels.{name}]")


def _wheels(tables: Mapping[str, Any]) -> Wheels:
    for name in _NAMES["differential"].values():
        if name in tables:
            raise VehicleError(
                "commands are of the body or of its wheels, not of both", where=f"channels.{name}",
                limit="speed and yaw_rate, or left and right", remedy=f"delete [channels.{name}], or left and right",
            )  # fmt: skip
    check_keys(tables, (*WheelCommand._fields, *_LENGTHS), where="channels")
    _require_tables(tables, WheelCommand._fields)
    angular = "wheel_radius_m" in tables
    si = "rad/s" if angular else "m/s"
    lengths = {name: _finite(tables[name], f"channels.{name}") for name in _LENGTHS if name in tables}
    left, right = (_from_table(tables[name], name, si) for name in WheelCommand._fields)
    if left.unit == "si" and "track_m" not in tables:
        raise VehicleError(
            "the distance between both wheels is missing",
            where="channels.track_m",
            remedy="add track_m = … in [channels]",
        )
    return Wheels(left, right, **lengths)


def _wheel_tables(wheels: Wheels) -> dict[str, Any]:
    si = "rad/s" if wheels.wheel_radius_m else "m/s"
    lengths = {name: value for name in _LENGTHS if (value := getattr(wheels, name))}
    return lengths | {name: _to_table(getattr(wheels, name), si) for name in WheelCommand._fields}


def _from_table(table: object, name: str, si: str) -> Channel:
    """Return the channel of a table, whose SI unit has the symbol `si`."""
    where = f"channels.{name}"
    if not isinstance(table, Mapping):
        raise VehicleError("must be a table", where=where, value=repr(table))
    check_keys(table, _KEYS, where=where)
    for key in _KEYS:
        if key not in table:
            raise VehicleError("a key is missing", where=where, value=key, remedy=f"add {key} = …")
    units: dict[object, CommandUnit] = {"us": "us", "normalised": "normalised", si: "si"}
    unit = table["unit"]
    if not isinstance(unit, str) or unit not in units:
        remedy = "add wheel_radius_m = … in [channels]" if unit == "rad/s" and si == "m/s" and name != "drive" else ""
        raise VehicleError("unknown unit", where=f"{where}.unit", value=repr(unit), limit=OneOf(units), remedy=remedy)
    neutral, low, high = (_finite(table[key], f"{where}.{key}") for key in _KEYS[1:])
    try:
        return Channel(units[unit], neutral, low, high)
    except VehicleError as error:
        raise located(error, where) from None


def _finite(value: object, where: str) -> float:
    found = number(value, where=where)
    if math.isinf(found):
        raise VehicleError("must be a finite number", where=where, value=found)
    return found


def _to_table(channel: Channel, si: str) -> dict[str, Any]:
    unit = si if channel.unit == "si" else channel.unit
    return {"unit": unit, "neutral": channel.neutral, "low": channel.low, "high": channel.high}
