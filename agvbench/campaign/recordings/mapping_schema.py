"""The keys of a mapping file: what a foreign recording's columns mean (schema 1)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import msgspec

from agvbench.campaign.header import SCHEMA, CampaignHeader, FrameRate
from agvbench.types import CommandUnit
from agvbench.vehicle.quaternion import Axis

ISO_8601 = "iso8601"

# Bounded, so that no product of them overflows; NaN is within no bound.
_MOST = 1e12
_Number = Annotated[float, msgspec.Meta(ge=-_MOST, le=_MOST)]
_Positive = Annotated[float, msgspec.Meta(gt=0.0, le=_MOST)]
_NotNegative = Annotated[float, msgspec.Meta(ge=0.0, le=_MOST)]


class _Strict(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """A table in which a misspelt key is an error."""


class Vehicle(_Strict, frozen=True):
    """As ``[vehicle]`` of ``campaign.toml``."""

    name: str
    front_axle_m: float
    rear_axle_m: float
    command_unit: CommandUnit
    neutral: float


class Mocap(_Strict, frozen=True):
    """As ``[mocap]`` of ``campaign.toml``."""

    rate_hz: FrameRate


class PredictionSettings(_Strict, frozen=True):
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
    """A command column: command = cell · scale + offset, in the vehicle's command unit."""

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
    drive: Signal
    front: Signal
    rear: Signal | None = None
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
    csv: Csv = Csv()
    gate: Gate | None = None
    runs: Runs = Runs()
    files: list[FileRule] = []

    def header(self, path: Path) -> CampaignHeader:
        """Return the head of the campaign that this mapping, read from `path`, makes.

        Raises
        ------
        CampaignError
            If the vehicle's geometry is impossible.
        """
        prediction = self.prediction
        return CampaignHeader.made_for(
            path,
            schema=SCHEMA,
            name=self.name,
            vehicle_name=self.vehicle.name,
            front_axle_m=self.vehicle.front_axle_m,
            rear_axle_m=self.vehicle.rear_axle_m,
            command_unit=self.vehicle.command_unit,
            neutral=self.vehicle.neutral,
            mocap_rate_hz=self.mocap.rate_hz,
            prediction_horizon_s=prediction.horizon_s if prediction else None,
            prediction_stride_s=prediction.stride_s or prediction.horizon_s if prediction else None,
        )
