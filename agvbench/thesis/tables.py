"""The thesis' tables as arrays: steering, drive, cornering, endurance and end poses."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache

import numpy as np

from agvbench.errors import FileError
from agvbench.resources import resource_directory
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry

#: Table 5.1: from the markers' centroid to the axles.
GEOMETRY = Geometry(front_axle_m=0.181, rear_axle_m=0.121)
STATISTICS = ("min", "q1", "median", "q3", "max")


class NumberedColumns:
    """A table as printed: its rows by column name, every cell as text."""

    def __init__(self, rows: list[dict[str, str]]) -> None:
        self.rows = rows

    def number(self, name: str) -> Floats:
        """Return a column of numbers."""
        return np.array([float(row[name]) for row in self.rows])


def load_table(name: str) -> NumberedColumns:
    """Return one transcribed table, for example ``"table_7_4_straight_speed"``.

    Raises
    ------
    FileError
        If the installation lacks the table, or it cannot be read.
    """
    path = resource_directory("reports") / "reference" / "thesis" / f"{name}.csv"
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            return NumberedColumns(list(csv.DictReader(stream)))
    except OSError as error:
        raise FileError(
            "table of the thesis cannot be read", where=path, value=error.strerror, remedy="install agvbench again"
        ) from None


@dataclass(frozen=True)
class SteeringTable:
    """One axle's answer to its own servo: pulses [µs] and the five statistics [deg], each of shape (n,)."""

    axle: str
    pulse_us: Floats
    angle_deg: dict[str, Floats]

    @property
    def median_deg(self) -> Floats:
        """The medians [deg], which the thesis fits."""
        return self.angle_deg["median"]


def _steering(table: str, axle: str) -> SteeringTable:
    rows = load_table(table)
    angles = {s: rows.number(f"{axle}_{s}_deg") for s in STATISTICS}
    return SteeringTable(axle, rows.number("pulse_us"), angles)


@cache
def steering_table(axle: str) -> SteeringTable:
    """Return table 7.1's front or table 7.2's rear axle, each against its own servo's pulse."""
    names = {"front": "table_7_1_front_servo_varied", "rear": "table_7_2_rear_servo_varied"}
    return _steering(names[axle], axle)


@cache
def idle_axle_table(axle: str) -> SteeringTable:
    """Return the axle that stood at 1500 µs while the *other* servo varied: table 7.2's front, table 7.1's rear."""
    names = {"front": "table_7_2_rear_servo_varied", "rear": "table_7_1_front_servo_varied"}
    return _steering(names[axle], axle)


@cache
def verification_table() -> tuple[Floats, Floats, Floats]:
    """Return table 6.1: pulse [µs], front and rear angle [deg], measured before chapter 7's calibration."""
    rows = load_table("table_6_1_axle_angle")
    return rows.number("pulse_us"), rows.number("front_deg"), rows.number("rear_deg")


@cache
def drive_table() -> tuple[Floats, Floats]:
    """Return table 7.4: drive pulse [µs] and straight speed [m/s]."""
    rows = load_table("table_7_4_straight_speed")
    return rows.number("drive_pulse_us"), rows.number("speed_mps")


@dataclass(frozen=True)
class CorneringTable:
    """Appendix B as ``speed_mps[mode][i, j]`` for drive pulse i and steering pulse j; speeds are unsigned."""

    drive_us: Floats
    steering_us: Floats
    speed_mps: dict[str, Floats]


@cache
def cornering_table() -> CorneringTable:
    """Return appendix B: 16 drive pulses, 7 steering pulses, modes ``single``, ``double`` and ``crab``."""
    table = load_table("appendix_b_cornering_speed")
    drive_us, steering_us = (np.unique(table.number(c)) for c in ("drive_pulse_us", "steering_pulse_us"))
    grids: dict[str, Floats] = {}
    for row in table.rows:
        grid = grids.setdefault(row["mode"], np.full((len(drive_us), len(steering_us)), np.nan))
        i = np.searchsorted(drive_us, float(row["drive_pulse_us"]))
        grid[i, np.searchsorted(steering_us, float(row["steering_pulse_us"]))] = float(row["speed_mps"])
    return CorneringTable(drive_us, steering_us, grids)


@cache
def endurance_table() -> tuple[Floats, Floats]:
    """Return table 8.2: start of each interval [s] and its mean speed [m/s]."""
    rows = load_table("table_8_2_endurance_intervals")
    return rows.number("start_s"), rows.number("speed_mps")


@dataclass(frozen=True)
class MeasuredRow:
    """One row of tables 8.3–8.10: the median over ten drives, as printed (unsigned), with its quartiles."""

    trajectory: int
    condition: str
    quantity: str
    median: float
    q1: float
    q3: float


@cache
def end_pose_rows() -> tuple[MeasuredRow, ...]:
    """Return the 28 rows of tables 8.3–8.10 in their order; Δs in mm, heading in deg."""
    rows = load_table("tables_8_3_to_8_10_end_pose").rows
    return tuple(
        MeasuredRow(
            int(r["trajectory"]), r["vehicle"], r["quantity"], float(r["median"]), float(r["q1"]), float(r["q3"])
        )
        for r in rows
    )


@cache
def endurance_percentiles() -> dict[int, float]:
    """Return table 8.1: percentile and speed [m/s]."""
    rows = load_table("table_8_1_endurance_percentiles")
    return dict(zip(rows.number("percentile").astype(int).tolist(), rows.number("speed_mps").tolist(), strict=True))


def rms(values: Floats) -> float:
    """Return the root mean square.

    >>> rms(np.array([3.0, 4.0, 0.0, 0.0]))
    2.5
    """
    return float(np.sqrt(np.mean(np.square(values))))
