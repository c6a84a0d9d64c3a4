"""Small campaigns and recordings for the tests, written without the code under test."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import tomli_w

from agvbench.campaign import CampaignHeader
from agvbench.types import Commands, Frames, Pose, Run
from agvbench.vehicle.channels import Channels

HEADER = CampaignHeader(
    schema=1,
    name="sample",
    vehicle_name="thesis",
    front_axle_m=0.11,
    rear_axle_m=0.09,
    channels=Channels.alike("us"),
    mocap_rate_hz=120.0,
)


def head() -> dict[str, Any]:
    """Return ``campaign.toml`` as a table."""
    return {
        "schema": 1,
        "name": "sample",
        "vehicle": {
            "name": "thesis",
            "front_axle_m": 0.11,
            "rear_axle_m": 0.09,
            "command_unit": "us",
            "neutral": 1500.0,
        },
        "mocap": {"rate_hz": 120.0},
    }


def tables() -> dict[str, dict[str, list[Any]]]:
    """Return runs a and b of a sound campaign as columns: two commands and three poses each."""
    return {
        "runs": {
            "run_id": ["a", "b"],
            "experiment": ["trajectory", "drive"],
            "trajectory": ["1", ""],
            "condition": ["calibrated", ""],
            "repeat": [1, 0],
            "target_x_m": [2.0, np.nan],
            "target_y_m": [0.0, np.nan],
            "target_heading_rad": [0.0, np.nan],
            "started_s": [0.0, 10.0],
            "status": ["ok", "ok"],
            "firmware": ["1.0", "1.0"],
        },
        "commands": {
            "run_id": ["a", "a", "b", "b"],
            "t_s": [0.0, 1.0, 0.0, 1.0],
            "drive": [1900.0, 1500.0, 1850.0, 1500.0],
            "front": [1500.0, 1500.0, 1400.0, 1500.0],
            "rear": [1500.0, 1500.0, 1600.0, 1500.0],
        },
        "poses": {
            "run_id": ["a", "a", "a", "b", "b", "b"],
            "t_s": [0.0, 0.5, 1.0, 0.0, 0.5, 1.0],
            "x_m": [0.0, 0.1, 0.2, 1.0, 1.1, 1.2],
            "y_m": [0.0, 0.0, 0.0, 2.0, 2.0, 2.0],
            "heading_rad": [0.0, 0.0, 0.0, 3.1, -3.1, 3.1],
            "tracked": [True] * 6,
        },
    }


def write_head(directory: Path, table: dict[str, Any] | None = None) -> Path:
    """Write ``campaign.toml``."""
    directory.mkdir(exist_ok=True)
    (directory / "campaign.toml").write_text(tomli_w.dumps(table or head()))
    return directory


def write_campaign(directory: Path, columns: dict[str, dict[str, list[Any]]] | None = None) -> Path:
    """Write a campaign whose tables are single parquet files."""
    write_head(directory)
    for name, table in (columns or tables()).items():
        pq.write_table(pa.table(table), directory / f"{name}.parquet")
    return directory


def write_csv(path: Path, columns: dict[str, list[Any]], *, delimiter: str = ",", encoding: str = "utf-8") -> Path:
    """Write columns as CSV, without quoting."""
    lines = [delimiter.join(columns), *(delimiter.join(map(str, row)) for row in zip(*columns.values(), strict=True))]
    path.write_bytes(("\n".join(lines) + "\n").encode(encoding))
    return path


def make_run(run_id: str, *, frames: int = 24, seed: int = 0, **changes: Any) -> Run:
    """Return a run with commands at 10 Hz and poses at 120 Hz, the last frame lost."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(frames) / 120.0
    tracked = np.arange(frames) < frames - 1
    x_m, y_m, heading_rad = (np.where(tracked, rng.normal(size=frames), np.nan) for _ in range(3))
    when = np.arange(5) / 10.0
    values: dict[str, Any] = {
        "run_id": run_id,
        "experiment": "trajectory",
        "trajectory": "1",
        "condition": "calibrated",
        "repeat": 1,
        "target": Pose(2.0, 0.0, 0.0),
        "started_s": 0.0,
        "status": "ok",
        "firmware": "1.0",
        "commands": Commands(when, *rng.uniform(1000.0, 2000.0, (3, 5))),
        "frames": Frames(
            t_s, x_m, y_m, heading_rad, tracked, np.arange(frames), rng.uniform(0.0, 1e-3, frames), t_s + 0.004
        ),
    }
    return Run(**(values | changes))


def assert_same_run(one: Run, other: Run) -> None:
    """Compare runs bit by bit, NaN equal to NaN."""
    for name in ("run_id", "experiment", "trajectory", "condition", "repeat", "started_s", "status", "firmware"):
        assert getattr(one, name) == getattr(other, name)
    assert (one.session, one.split, dict(one.extra)) == (other.session, other.split, dict(other.extra))
    np.testing.assert_array_equal(one.target, other.target)
    for name in ("t_s", "drive", "front", "rear"):
        np.testing.assert_array_equal(getattr(one.commands, name), getattr(other.commands, name))
    for name in ("t_s", "x_m", "y_m", "heading_rad", "tracked", "frame", "mean_error_m", "received_s"):
        np.testing.assert_array_equal(getattr(one.frames, name), getattr(other.frames, name))


MAPPING = """\
schema = 1
name = "lab"

[vehicle]
name = "mule"
front_axle_m = 0.1
rear_axle_m = 0.1
command_unit = "us"
neutral = 1500.0

[mocap]
rate_hz = 100.0

[columns]
time = { column = "t", unit = "ms" }
x = { column = "X", unit = "mm" }
y = { column = "Z", unit = "mm", scale = -1.0 }
heading = { column = "yaw", unit = "deg" }
drive = { column = "throttle" }
front = { column = "steer" }
driven = { column = "armed", equals = 1 }

[runs]
gap_s = 0.5
shortest_s = 0.2
"""


def recording(rows: int = 60) -> dict[str, list[Any]]:
    """Return a y-up recording in mm, ms and degrees of a vehicle that drives along floor y at 0.5 m/s."""
    return {
        "t": [10 * row for row in range(rows)],
        "X": [1000.0] * rows,
        "Z": [-5.0 * row for row in range(rows)],
        "yaw": [90.0] * rows,
        "throttle": [1900 if row < rows // 2 else 1800 for row in range(rows)],
        "steer": [1500] * rows,
        "armed": [1] * rows,
    }
