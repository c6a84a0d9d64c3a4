"""The head of a campaign: ``campaign.toml`` (schemas 1 to 4)."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any

import msgspec

from agvbench.campaign.manifest import record
from agvbench.campaign.uncertainty_statement import read_statement
from agvbench.errors import CampaignError, FileError, VehicleError
from agvbench.labels import checked_labels
from agvbench.text_files import read_toml
from agvbench.types import Command, CommandUnit, Kinematics
from agvbench.validation import convert
from agvbench.vehicle.channel_tables import channel_names, channels_from_keys, channels_to_keys
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Driven, Geometry

SCHEMA = 1
SCHEMA_OF_DRIVEN_AXLE = 2
"""The schema that knows ``driven``; campaigns of vehicles that both axles drive are written in schema 1."""
SCHEMA_OF_KINEMATICS = 3
"""The schema that knows ``kinematics`` and commands in SI units."""
SCHEMA_OF_CHANNELS = 4
"""The schema that knows the tables ``[channels.NAME]``."""
_SCHEMAS = (SCHEMA, SCHEMA_OF_DRIVEN_AXLE, SCHEMA_OF_KINEMATICS, SCHEMA_OF_CHANNELS)
FILE_NAME = "campaign.toml"
_MAX_BYTES = 1 << 20

_Positive = Annotated[float, msgspec.Meta(gt=0.0)]
FrameRate = Annotated[float, msgspec.Meta(gt=0.0, le=1e6)]
"""Of a camera [Hz]; above, times of frames cannot be distinguished in nanoseconds."""


def schema_for(driven: Driven, kinematics: Kinematics, channels: Channels) -> int:
    """Return the lowest schema that describes a vehicle."""
    if (common := channels.common) is None:
        return SCHEMA_OF_CHANNELS
    if kinematics != "two_axle" or common.unit == "si":
        return SCHEMA_OF_KINEMATICS
    return SCHEMA if driven == "both" else SCHEMA_OF_DRIVEN_AXLE


@dataclass(frozen=True)
class CampaignHeader:
    """What holds for every run of a campaign.

    ``front_axle_m`` and ``rear_axle_m`` [m] are the distances from the markers' centroid to the axles, as in
    `Geometry`; ``driven`` is the driven axle, ``kinematics`` the kind of kinematics; ``channels`` are the units,
    neutral commands and ranges of the command channels; ``prediction_horizon_s`` and ``prediction_stride_s`` [s] say
    how to cut free driving into predictions. ``labels`` are what the lab notes of the circumstances (tyres, floor),
    ``uncertainty`` what it states of uncertainties that no run shows (`agvbench.campaign.uncertainty_statement`).

    Raises
    ------
    CampaignError
        If a value is not finite or out of its range.
    """

    schema: int
    name: str
    vehicle_name: str
    front_axle_m: float
    rear_axle_m: float
    channels: Channels
    mocap_rate_hz: float
    prediction_horizon_s: float | None = None
    prediction_stride_s: float | None = None
    driven: Driven = "both"
    kinematics: Kinematics = "two_axle"
    labels: Mapping[str, str] = field(default_factory=dict)
    uncertainty: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check_schema(self.schema, FILE_NAME)
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, float) and not math.isfinite(value):
                raise CampaignError(
                    f"{item.name} is not a finite number", where=FILE_NAME, value=value, remedy="give a number"
                )
        self._require_schema(schema_for(self.driven, self.kinematics, self.channels))
        if self.kinematics == "two_axle" and self.front_axle_m + self.rear_axle_m <= 0.0:
            raise CampaignError(
                "the wheelbase front_axle_m + rear_axle_m is not positive",
                where=f"{FILE_NAME}: [vehicle]",
                value=f"{self.front_axle_m + self.rear_axle_m:g} m",
                remedy="give the distances from the markers' centroid to the axles in metres",
            )

    def _require_schema(self, needed: int) -> None:
        if self.schema >= needed:
            return
        common = self.channels.common
        given = {
            "[channels]": common is None,
            f'kinematics = "{self.kinematics}"': self.kinematics != "two_axle",
            'command_unit = "si"': common is not None and common.unit == "si",
            f'driven = "{self.driven}"': True,
        }
        text = next(text for text, is_given in given.items() if is_given)
        raise CampaignError(
            f"{text.partition(' ')[0]} needs a newer schema",
            where=f"{FILE_NAME}: [vehicle]" if common else FILE_NAME,
            value=f"{text} in schema {self.schema}",
            limit=f"schema {needed}",
            remedy=f"set schema = {needed}",
        )

    @property
    def neutral(self) -> Command:
        """The command at which the vehicle stands still and steers straight."""
        return self.channels.neutral

    @property
    def command_columns(self) -> Mapping[str, str]:
        """The columns of the commands table, by role: the names of the channels where each has its own table.

        Wheel commands have the places of drive and front; see `agvbench.campaign.tables.command_columns`.
        """
        if self.channels.wheels is not None:
            return {"drive": "left", "front": "right"}
        return channel_names("two_axle" if self.channels.common else self.kinematics)

    @property
    def geometry(self) -> Geometry:
        """The axles: their distances from the markers' centroid, and which of them drives.

        Raises
        ------
        VehicleError
            If an axle is not where a vehicle can have it.
        """
        return Geometry(self.front_axle_m, self.rear_axle_m, self.driven, self.kinematics)

    @classmethod
    def load(cls, path: str | Path) -> CampaignHeader:
        """Read ``campaign.toml``; keys that no schema knows are left alone.

        Raises
        ------
        CampaignError
            If the file is missing, is not TOML, has another schema, or lacks or misuses a key.
        """
        path = Path(path)
        table = _read_toml(path)
        _check_schema(table.get("schema"), path)
        remedy = "correct campaign.toml (docs/reference/campaign-directory.md)"
        file = convert(table, _File, where=str(path), error=CampaignError, remedy=remedy)
        header = cls.from_tables(
            path, file.name, file.vehicle, file.mocap, file.prediction, channels=file.channels, schema=file.schema
        )
        labels = checked_labels(file.labels, where=f"{path}: labels", error=CampaignError)
        return replace(header, labels=labels, uncertainty=read_statement(file.uncertainty, path, CampaignError))

    @classmethod
    def from_tables(
        cls,
        where: object,
        name: str,
        vehicle: Vehicle,
        mocap: Mocap,
        prediction: Prediction | None,
        *,
        channels: ChannelTables | None = None,
        schema: int | None = None,
    ) -> CampaignHeader:
        """Return the header that these tables make; an impossible value is a `CampaignError` of file `where`.

        Without `schema` it is the lowest that describes the vehicle.
        """
        prediction = prediction or Prediction()
        if vehicle.front_axle_m is None and vehicle.kinematics == "two_axle":
            raise CampaignError(
                "key 'front_axle_m' is missing",
                where=f"{where}: vehicle",
                remedy='give the distance to the front axle, or kinematics = "differential"',
            )
        described = _channels(where, vehicle, channels)
        try:
            return cls(
                schema=schema or schema_for(vehicle.driven, vehicle.kinematics, described),
                name=name,
                vehicle_name=vehicle.name,
                front_axle_m=vehicle.front_axle_m or 0.0,
                rear_axle_m=vehicle.rear_axle_m,
                channels=described,
                mocap_rate_hz=mocap.rate_hz,
                prediction_horizon_s=prediction.horizon_s,
                prediction_stride_s=prediction.stride_s or prediction.horizon_s,
                driven=vehicle.driven,
                kinematics=vehicle.kinematics,
            )
        except CampaignError as error:
            place = str(error.where).replace(FILE_NAME, str(where), 1)
            raise CampaignError(
                error.what, where=place, value=error.value, limit=error.limit, remedy=error.remedy
            ) from None

    def to_tables(self) -> dict[str, Any]:
        """Return the content of ``campaign.toml``, from which `load` makes the same header."""
        described = channels_to_keys(self.channels, self.kinematics)
        of_channels = {key: described.pop(key) for key in ("channels",) if key in described}
        table: dict[str, Any] = {
            "schema": self.schema,
            "name": self.name,
            "vehicle": {
                "name": self.vehicle_name,
                "front_axle_m": self.front_axle_m,
                "rear_axle_m": self.rear_axle_m,
                **described,
                **({} if self.driven == "both" else {"driven": self.driven}),
                **({} if self.kinematics == "two_axle" else {"kinematics": self.kinematics}),
            },
            **of_channels,
            "mocap": {"rate_hz": self.mocap_rate_hz},
        }
        prediction = {"horizon_s": self.prediction_horizon_s, "stride_s": self.prediction_stride_s}
        if given := {key: value for key, value in prediction.items() if value is not None}:
            table["prediction"] = given
        table |= {name: dict(of) for name in ("labels", "uncertainty") if (of := getattr(self, name))}
        return table

    def save(self, path: str | Path) -> None:
        """Write ``campaign.toml``, renamed into place when whole, and list its hash."""
        import tomli_w

        record(Path(path).parent, {Path(path).name: tomli_w.dumps(self.to_tables()).encode()})


class Vehicle(msgspec.Struct, frozen=True):
    """The table ``[vehicle]``."""

    name: str
    rear_axle_m: float
    command_unit: CommandUnit | None = None
    neutral: float | None = None
    front_axle_m: float | None = None
    driven: Driven = "both"
    kinematics: Kinematics = "two_axle"


ChannelTables = dict[str, dict[str, str | float] | float]
"""The tables ``[channels.NAME]``, and the lengths of wheel commands beside them."""


class Mocap(msgspec.Struct, frozen=True):
    """The table ``[mocap]``."""

    rate_hz: FrameRate


class Prediction(msgspec.Struct, frozen=True):
    """The table ``[prediction]``."""

    horizon_s: _Positive | None = None
    stride_s: _Positive | None = None


class _File(msgspec.Struct):
    schema: int
    name: str
    vehicle: Vehicle
    mocap: Mocap
    prediction: Prediction | None = None
    channels: ChannelTables | None = None
    labels: dict[str, Any] = {}
    uncertainty: dict[str, Any] = {}


def _channels(where: object, vehicle: Vehicle, tables: ChannelTables | None) -> Channels:
    """Return the channels of a head, or raise `CampaignError` for file `where`."""
    given = {"command_unit": vehicle.command_unit, "neutral": vehicle.neutral, "channels": tables}
    content = {key: value for key, value in given.items() if value is not None}
    for key in ("command_unit", "neutral") if tables is None else ():
        if key not in content:
            raise CampaignError(
                f"key '{key}' is missing", where=f"{where}: vehicle",
                remedy="give command_unit and neutral, or [channels] (docs/reference/campaign-directory.md)",
            )  # fmt: skip
    if vehicle.neutral is not None and not math.isfinite(vehicle.neutral):
        raise CampaignError(
            "neutral is not a finite number", where=where, value=vehicle.neutral, remedy="give a number"
        )
    try:
        return channels_from_keys(content, vehicle.kinematics)
    except VehicleError as error:
        place = f"{where}: {error.where}"
        raise CampaignError(
            error.what, where=place, value=error.value, limit=error.limit, remedy=error.remedy
        ) from None


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise CampaignError("is too large for a campaign's head", where=path, limit=f"{_MAX_BYTES} bytes")
        return read_toml(path)
    except FileError as error:
        raise CampaignError(error.what, where=path, limit=error.limit, remedy=error.remedy) from None
    except OSError as error:
        raise CampaignError(
            f"cannot be read ({error.strerror})",
            where=path,
            remedy="give a campaign directory: one with campaign.toml, runs, commands and poses",
        ) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise CampaignError(f"is not TOML ({error})", where=path, remedy="correct the line") from None


def _check_schema(schema: object, where: object) -> None:
    if schema is None:
        raise CampaignError("has no schema", where=where, remedy=f"add schema = {SCHEMA} at the top")
    if schema not in _SCHEMAS or isinstance(schema, bool):
        newer = isinstance(schema, int) and schema > SCHEMA
        remedy = "install a newer agvbench" if newer else f"set schema = {SCHEMA}"
        raise CampaignError(
            "was written in a schema that this agvbench does not read",
            where=where,
            value=f"schema {schema}",
            limit=f"schema {SCHEMA} to {_SCHEMAS[-1]}",
            remedy=remedy,
        )
