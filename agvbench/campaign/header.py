"""The head of a campaign: ``campaign.toml`` (schema 1)."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import msgspec

from agvbench.campaign.manifest import record
from agvbench.errors import CampaignError, FileError
from agvbench.text_files import read_toml
from agvbench.types import CommandUnit
from agvbench.validation import convert
from agvbench.vehicle.geometry import Driven, Geometry, Kinematics

SCHEMA = 1
SCHEMA_OF_DRIVEN_AXLE = 2
"""The schema that knows ``driven``; campaigns of vehicles that both axles drive are written in schema 1."""
SCHEMA_OF_KINEMATICS = 3
"""The schema that knows ``kinematics`` and commands in SI units."""
_SCHEMAS = (SCHEMA, SCHEMA_OF_DRIVEN_AXLE, SCHEMA_OF_KINEMATICS)
FILE_NAME = "campaign.toml"
_MAX_BYTES = 1 << 20

_Positive = Annotated[float, msgspec.Meta(gt=0.0)]
FrameRate = Annotated[float, msgspec.Meta(gt=0.0, le=1e6)]
"""Of a camera [Hz]; above, times of frames cannot be distinguished in nanoseconds."""


def schema_for(driven: Driven, kinematics: Kinematics = "two_axle", command_unit: CommandUnit = "us") -> int:
    """Return the lowest schema that describes a vehicle."""
    if kinematics != "two_axle" or command_unit == "si":
        return SCHEMA_OF_KINEMATICS
    return SCHEMA if driven == "both" else SCHEMA_OF_DRIVEN_AXLE


@dataclass(frozen=True)
class CampaignHeader:
    """What holds for every run of a campaign.

    ``front_axle_m`` and ``rear_axle_m`` [m] are the distances from the markers' centroid to the axles, as in
    `Geometry`; ``driven`` is the driven axle, ``kinematics`` the kind of kinematics; ``neutral`` is the command at
    which the vehicle stands still and steers straight,
    in ``command_unit``; ``prediction_horizon_s`` and ``prediction_stride_s`` [s] say how to cut free driving into
    predictions.

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
    command_unit: CommandUnit
    neutral: float
    mocap_rate_hz: float
    prediction_horizon_s: float | None = None
    prediction_stride_s: float | None = None
    driven: Driven = "both"
    kinematics: Kinematics = "two_axle"

    def __post_init__(self) -> None:
        _check_schema(self.schema, FILE_NAME)
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, float) and not math.isfinite(value):
                raise CampaignError(
                    f"{field.name} is not a finite number", where=FILE_NAME, value=value, remedy="give a number"
                )
        needed = schema_for(self.driven, self.kinematics, self.command_unit)
        if self.schema < needed:
            key, value = next(
                (key, value)
                for key, value in (
                    ("kinematics", self.kinematics),
                    ("command_unit", self.command_unit),
                    ("driven", self.driven),
                )
                if value not in ("two_axle", "us", "normalised", "both")
            )
            raise CampaignError(
                f"{key} needs a newer schema",
                where=f"{FILE_NAME}: [vehicle]",
                value=f'{key} = "{value}" in schema {self.schema}',
                limit=f"schema {needed}",
                remedy=f"set schema = {needed}",
            )
        if self.kinematics == "two_axle" and self.front_axle_m + self.rear_axle_m <= 0.0:
            raise CampaignError(
                "the wheelbase front_axle_m + rear_axle_m is not positive",
                where=f"{FILE_NAME}: [vehicle]",
                value=f"{self.front_axle_m + self.rear_axle_m:g} m",
                remedy="give the distances from the markers' centroid to the axles in metres",
            )

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
        """Read ``campaign.toml``; keys that schema 1 does not know are left alone.

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
        return cls.from_tables(path, file.name, file.vehicle, file.mocap, file.prediction, schema=file.schema)

    @classmethod
    def from_tables(
        cls,
        where: object,
        name: str,
        vehicle: Vehicle,
        mocap: Mocap,
        prediction: Prediction | None,
        *,
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
        try:
            return cls(
                schema=schema or schema_for(vehicle.driven, vehicle.kinematics, vehicle.command_unit),
                name=name,
                vehicle_name=vehicle.name,
                front_axle_m=vehicle.front_axle_m or 0.0,
                rear_axle_m=vehicle.rear_axle_m,
                command_unit=vehicle.command_unit,
                neutral=vehicle.neutral,
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

    def save(self, path: str | Path) -> None:
        """Write ``campaign.toml``, renamed into place when whole, and list its hash."""
        import tomli_w

        table: dict[str, Any] = {
            "schema": self.schema,
            "name": self.name,
            "vehicle": {
                "name": self.vehicle_name,
                "front_axle_m": self.front_axle_m,
                "rear_axle_m": self.rear_axle_m,
                "command_unit": self.command_unit,
                "neutral": self.neutral,
                **({} if self.driven == "both" else {"driven": self.driven}),
                **({} if self.kinematics == "two_axle" else {"kinematics": self.kinematics}),
            },
            "mocap": {"rate_hz": self.mocap_rate_hz},
        }
        prediction = {"horizon_s": self.prediction_horizon_s, "stride_s": self.prediction_stride_s}
        if given := {key: value for key, value in prediction.items() if value is not None}:
            table["prediction"] = given
        record(Path(path).parent, {Path(path).name: tomli_w.dumps(table).encode()})


class Vehicle(msgspec.Struct, frozen=True):
    """The table ``[vehicle]``."""

    name: str
    rear_axle_m: float
    command_unit: CommandUnit
    neutral: float
    front_axle_m: float | None = None
    driven: Driven = "both"
    kinematics: Kinematics = "two_axle"


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
