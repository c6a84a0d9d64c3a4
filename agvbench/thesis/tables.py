"""The thesis' tables as arrays: steering, drive, cornering, endurance and end poses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from agvbench.errors import FileError
from agvbench.resources import resource_directory
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry

if TYPE_CHECKING:
    import pandas as pd

#: Table 5.1: from the markers' centroid to the axles.
GEOMETRY = Geometry(front_axle_m=0.181, rear_axle_m=0.121)
NEUTRAL_US = 1500.0
STATISTICS = ("min", "q1", "median", "q3", "max")


def load_table(name: str) -> pd.DataFrame:
    """Return one transcribed table, for example ``"table_7_4_straight_speed"``.

    Raises
    ------
    FileError
        If the installation lacks the table, or it cannot be read.
    """
    import pandas as pd

    path = resource_directory("reports") / "reference" / "thesis" / f"{name}.csv"
    try:
        return pd.read_csv(path)
    except OSError as error:
        raise FileError(
            "table of the thesis cannot be read", where=path, value=error.strerror, remedy="install agvbench again"
        ) from None


def _columns(table: str, *names: str) -> list[Floats]:
    rows = load_table(table)
    return [rows[name].to_numpy(dtype=float) for name in names]


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
    pulse_us, *angles = _columns(table, "pulse_us", *(f"{axle}_{s}_deg" for s in STATISTICS))
    return SteeringTable(axle, pulse_us, dict(zip(STATISTICS, angles, strict=True)))


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
    pulse_us, front_deg, rear_deg = _columns("table_6_1_axle_angle", "pulse_us", "front_deg", "rear_deg")
    return pulse_us, front_deg, rear_deg


@cache
def drive_table() -> tuple[Floats, Floats]:
    """Return table 7.4: drive pulse [µs] and straight speed [m/s]."""
    pulse_us, speed_mps = _columns("table_7_4_straight_speed", "drive_pulse_us", "speed_mps")
    return pulse_us, speed_mps


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
    grids = {
        str(mode): rows.pivot(index="drive_pulse_us", columns="steering_pulse_us", values="speed_mps")
        for mode, rows in table.groupby("mode", sort=False)
    }
    drive_us, steering_us = (axis.to_numpy(dtype=float) for axis in next(iter(grids.values())).axes)
    return CorneringTable(drive_us, steering_us, {mode: grid.to_numpy(dtype=float) for mode, grid in grids.items()})


@cache
def endurance_table() -> tuple[Floats, Floats]:
    """Return table 8.2: start of each interval [s] and its mean speed [m/s]."""
    start_s, speed_mps = _columns("table_8_2_endurance_intervals", "start_s", "speed_mps")
    return start_s, speed_mps


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
    table = load_table("tables_8_3_to_8_10_end_pose")[["trajectory", "vehicle", "quantity", "median", "q1", "q3"]]
    return tuple(MeasuredRow(*row) for row in table.itertuples(index=False))


@cache
def endurance_percentiles() -> dict[int, float]:
    """Return table 8.1: percentile and speed [m/s]."""
    percentile, speed_mps = _columns("table_8_1_endurance_percentiles", "percentile", "speed_mps")
    return dict(zip(percentile.astype(int).tolist(), speed_mps.tolist(), strict=True))


def rms(values: Floats) -> float:
    """Return the root mean square.

    >>> rms(np.array([3.0, 4.0, 0.0, 0.0]))
    2.5
    """
    return float(np.sqrt(np.mean(np.square(values))))
