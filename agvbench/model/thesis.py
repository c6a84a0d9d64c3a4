"""The vehicle of the thesis, built from its tables.

``python -m agvbench.model.thesis`` writes the shipped file anew.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from agvbench.model.vehicle_model import VehicleModel
from agvbench.types import Floats
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.maps import LineWithEndStops, MonotoneTable

# Two points at each end of tables 7.1 and 7.2 are saturated; the thesis left out one and got flatter slopes.
_SATURATED = 2
_PROVENANCE = {
    "source": "T. Bentvelsen, Calibration of model AGVs, TU Delft 2015",
    "geometry": "table 5.1",
    "front": "least squares line through the medians of table 7.1, 1100 to 1900 us; end stops: mean of the rest",
    "rear": "least squares line through the medians of table 7.2, 1100 to 1900 us; end stops: mean of the rest",
    "drive": "medians of table 7.4, made monotone by isotonic regression",
    "built_by": "agvbench.model.thesis.build_thesis_vehicle",
}


def build_thesis_vehicle(tables: Path) -> VehicleModel:
    """Return the vehicle that the thesis measured, with nothing taken from its chapter 8.

    The speeds go into a measured curve and not into the cubic of eq. 7.3, which is 4–7 % low near half speed.

    Parameters
    ----------
    tables
        Directory with the thesis' tables as CSV (``reports/reference/thesis``).
    """
    front, rear = _steering(tables, "table_7_1", "front"), _steering(tables, "table_7_2", "rear")
    return VehicleModel(
        name="thesis",
        geometry=Geometry(front_axle_m=0.181, rear_axle_m=0.121),
        channels=Channels.alike("us"),
        front=front,
        rear=rear,
        drive=_drive(tables),
        provenance=_PROVENANCE,
    )


@dataclass(frozen=True)
class _Column:
    pulse_us: Floats
    value: Floats


def _steering(tables: Path, table: str, axle: str) -> LineWithEndStops:
    column = _read(tables / f"{table}_{axle}_servo_varied.csv", "pulse_us", f"{axle}_median_deg")
    angle = np.radians(column.value)
    line = slice(_SATURATED, -_SATURATED)
    slope, intercept = np.polyfit(column.pulse_us[line], angle[line], 1)
    return LineWithEndStops(
        slope=_rounded(slope),
        intercept=_rounded(intercept),
        output_low=_rounded(angle[-_SATURATED:].mean()),
        output_high=_rounded(angle[:_SATURATED].mean()),
    )


def _drive(tables: Path) -> MonotoneTable:
    from scipy.optimize import isotonic_regression

    column = _read(tables / "table_7_4_straight_speed.csv", "drive_pulse_us", "speed_mps")
    speed = isotonic_regression(column.value, increasing=False).x
    return MonotoneTable(tuple(column.pulse_us.tolist()), tuple(_rounded(v) for v in speed))


def _read(path: Path, pulse: str, value: str) -> _Column:
    with path.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    return _Column(np.array([float(row[pulse]) for row in rows]), np.array([float(row[value]) for row in rows]))


def _rounded(value: float) -> float:
    """Return nine significant digits: what does not hang on the machine that computed them."""
    return float(f"{value:.9g}") + 0.0


if __name__ == "__main__":
    from agvbench.resources import resource_directory

    build_thesis_vehicle(resource_directory("reports") / "reference" / "thesis").save(
        Path(__file__).parent / "data" / "thesis.toml"
    )
