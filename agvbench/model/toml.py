"""Vehicle files: TOML, schema 1.

::

    schema = 1
    name = "my_vehicle"
    command_unit = "us"            # or "normalised", "si"; a table [channels.NAME] for each channel in place of
    neutral = 1500.0               # command_unit and neutral: docs/reference/vehicle-file.md

    [geometry]
    front_axle_m = 0.181           # marker centroid to axle
    rear_axle_m = 0.121
    driven = "both"                # or "front", "rear"; "both" where it is left out
    kinematics = "two_axle"        # or "differential", whose front map is command → rad/s; "two_axle" where left out

    [maps.front]                   # and [maps.rear]: command → rad, counter-clockwise positive
    kind = "line_with_end_stops"
    unit = "rad"
    slope = -0.0015
    …

    [maps.drive]                   # command → m/s
    kind = "dead_band_with_saturation"
    unit = "m/s"
    …

    [[effects]]                    # as many as are known
    name = "steering_lag"
    time_constant_s = 0.12

    [priors.mocap_latency.latency_s]   # as many as are documented or were measured; see `agvbench.model.priors`
    value = 0.008
    standard_deviation = 0.001
    source = "data sheet"

    [provenance]                   # free
"""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w

from agvbench.effects import Effect, effect_from_toml
from agvbench.errors import FileError, VehicleError
from agvbench.model.priors import priors_from_toml, priors_to_toml
from agvbench.text_files import read_toml
from agvbench.vehicle.channel_tables import channels_from_keys, channels_to_keys
from agvbench.vehicle.fields import check_keys, from_table, to_table
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.maps import StaticMap, map_from_toml

if TYPE_CHECKING:
    from agvbench.model.vehicle_model import VehicleModel

SCHEMA = 1
_UNITS = {"front": "rad", "rear": "rad", "drive": "m/s"}
_DEFAULTS = {"driven": "both", "kinematics": "two_axle"}
_COMMON = ("command_unit", "neutral")
_REQUIRED = ("schema", "name", "geometry", "maps")
_OPTIONAL = (*_COMMON, "channels", "effects", "priors", "provenance")


def read_vehicle(path: Path) -> dict[str, Any]:
    """Return the fields of the `VehicleModel` that a vehicle file describes.

    Raises
    ------
    FileError
        If the file is missing, unreadable or no TOML.
    VehicleError
        If its content is no vehicle of schema 1, naming file, key and what is wrong.
    """
    try:
        content = read_toml(path)
    except OSError as error:
        raise FileError("cannot read the vehicle file", where=path, value=error.strerror) from None
    except UnicodeDecodeError:
        raise FileError("the vehicle file is not UTF-8 text", where=path) from None
    except tomllib.TOMLDecodeError as error:
        raise FileError("the vehicle file is not TOML", where=path, value=error) from None
    return vehicle_fields(content)


@contextmanager
def naming_file(path: Path) -> Iterator[None]:
    """Add `path` to the place that a `VehicleError` raised inside names."""
    try:
        yield
    except VehicleError as error:
        place = str(path) if error.where is None else f"{path}: {error.where}"
        raise VehicleError(error.what, where=place, value=error.value, limit=error.limit, remedy=error.remedy) from None


def write_vehicle(model: VehicleModel, path: Path) -> None:
    """Write `model` as a vehicle file.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    try:
        path.write_text(tomli_w.dumps(vehicle_to_toml(model)), encoding="utf-8")
    except OSError as error:
        raise FileError("cannot write the vehicle file", where=path, value=error.strerror) from None


def vehicle_to_toml(model: VehicleModel) -> dict[str, Any]:
    """Return `model` as the content of a vehicle file."""
    content: dict[str, Any] = {
        "schema": SCHEMA,
        "name": model.name,
        **channels_to_keys(model.channels, model.geometry.kinematics),
        "geometry": _geometry_to_toml(model.geometry),
        "maps": {role: _map_to_toml(getattr(model, role), unit) for role, unit in _units(model.geometry).items()},
    }
    if model.effects:
        content["effects"] = [effect.to_toml() for effect in model.effects]
    if model.priors:
        content["priors"] = priors_to_toml(model.priors)
    if model.provenance:
        content["provenance"] = dict(model.provenance)
    return content


def vehicle_fields(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of the `VehicleModel` in the content of a vehicle file; raise `VehicleError` if it is none."""
    _check_schema(content)
    check_keys(content, (*_REQUIRED, *_OPTIONAL), where="top level")
    for key in (*_REQUIRED, *(_COMMON if "channels" not in content else ())):
        if key not in content:
            raise VehicleError("a key is missing", where="top level", value=key, remedy=f"add {key}")
    if not isinstance(content["name"], str):
        raise VehicleError("must be a text", where="name", value=repr(content["name"]))
    geometry = from_table(Geometry, _whole_geometry(_table(content, "geometry")), where="geometry")
    return {
        "name": content["name"],
        "geometry": geometry,
        "channels": channels_from_keys(content, geometry.kinematics),
        **_maps_from_toml(_table(content, "maps"), _units(geometry)),
        "effects": _effects_from_toml(content.get("effects", [])),
        "priors": priors_from_toml(_table(content, "priors")) if "priors" in content else (),
        "provenance": _provenance_from_toml(content),
    }


def physics_digest(model: VehicleModel) -> str:
    """Return the first sixteen hexadecimal digits of SHA-256 over what is physical in `model`."""
    content = vehicle_to_toml(model)
    physics = {key: content[key] for key in content.keys() - {"name", "effects", "priors", "provenance"}}
    acting = sorted((effect for effect in model.effects if not effect.is_null), key=lambda effect: effect.name)
    physics["effects"] = [effect.to_toml() for effect in acting]
    # Adding zero makes −0.0 and 0.0, which drive alike, hash alike.
    text = json.dumps(_positive_zeros(physics), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _positive_zeros(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _positive_zeros(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_positive_zeros(item) for item in value]
    return value + 0.0 if isinstance(value, float) else value


def _check_schema(content: Mapping[str, Any]) -> None:
    schema = content.get("schema")
    if schema is None:
        raise VehicleError("a key is missing", where="top level", value="schema", remedy=f"add schema = {SCHEMA}")
    if schema != SCHEMA or isinstance(schema, bool):
        remedy = "this file was written for another agvbench"
        raise VehicleError("unknown schema", where="schema", value=repr(schema), limit=SCHEMA, remedy=remedy)


def _table(content: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    table = content[key]
    if not isinstance(table, Mapping):
        raise VehicleError("must be a table", where=key, value=repr(table))
    return table


def _whole_geometry(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table with what goes without saying: a differential vehicle has no front axle."""
    implied = {"front_axle_m": 0.0} if table.get("kinematics") == "differential" else {}
    return {**implied, **table}


def _geometry_to_toml(geometry: Geometry) -> dict[str, Any]:
    """Return the geometry without texts at their defaults, so that files and hashes of such vehicles stay."""
    return {key: value for key, value in to_table(geometry).items() if _DEFAULTS.get(key) != value}


def _units(geometry: Geometry) -> dict[str, str]:
    return _UNITS | ({"front": "rad/s"} if geometry.is_differential else {})


def _map_to_toml(static_map: StaticMap, unit: str) -> dict[str, Any]:
    table = static_map.to_toml()
    return {"kind": table.pop("kind"), "unit": unit, **table}


def _maps_from_toml(tables: Mapping[str, Any], units: Mapping[str, str]) -> dict[str, StaticMap]:
    check_keys(tables, units, where="maps")
    maps = {}
    for role, unit in units.items():
        where = f"maps.{role}"
        if role not in tables:
            raise VehicleError("a table is missing", where=where, remedy=f"add [{where}]")
        table = dict(_table(tables, role)) if isinstance(tables[role], Mapping) else tables[role]
        if isinstance(table, dict) and (given := table.pop("unit", unit)) != unit:
            raise VehicleError("wrong unit", where=f"{where}.unit", value=repr(given), limit=unit, remedy="convert")
        maps[role] = map_from_toml(table, where=where)
    return maps


def _effects_from_toml(tables: object) -> tuple[Effect, ...]:
    if not isinstance(tables, list):
        raise VehicleError("must be a list of tables", where="effects", remedy="write [[effects]]")
    return tuple(effect_from_toml(table, where=f"effects[{i}]") for i, table in enumerate(tables))


def _provenance_from_toml(content: Mapping[str, Any]) -> dict[str, str | float | int]:
    if "provenance" not in content:
        return {}
    provenance = dict(_table(content, "provenance"))
    for key, value in provenance.items():
        if not isinstance(value, (str, int, float)):
            raise VehicleError("must be a text or a number", where=f"provenance.{key}", value=repr(value))
    return provenance
