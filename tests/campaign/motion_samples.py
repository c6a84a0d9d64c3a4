"""Campaigns of a kinematic vehicle and what recordings do to them, written without the code under test."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
from campaign_samples import write_head

Poses = pd.DataFrame
Change = Callable[[Poses], Poses]
RATE_HZ = 50.0


def reversed_in_time(poses: Poses) -> Poses:
    """Return poses whose last comes first, as ``t_s`` counted backward gives them."""
    ends = poses.groupby("run_id")["t_s"].agg(["min", "max"]).sum(axis=1)
    return poses.assign(t_s=poses["run_id"].map(ends) - poses["t_s"])


WRONG: dict[str, tuple[Change, str]] = {
    "millimetres": (lambda p: p.assign(x_m=1e3 * p.x_m, y_m=1e3 * p.y_m), "x_m (and y_m are|is) not in metres"),
    "centimetres": (lambda p: p.assign(x_m=1e2 * p.x_m, y_m=1e2 * p.y_m), "x_m (and y_m are|is) not in metres"),
    "degrees": (
        lambda p: p.assign(heading_rad=np.degrees(p.heading_rad)),
        "heading_rad (is not in radians|looks like degrees)",
    ),
    "reversed": (reversed_in_time, "poses run backward in time"),
}


def _drive(speed_mps: float, lag_s: float, course_rad: float, told: pd.DataFrame) -> Poses:
    """Return the poses of commands in which 1500 is rest and straight, 900 full speed forward and 1/m to the left."""
    t_s = np.arange(0.0, told["t_s"].iloc[-1] + 0.6, 1.0 / RATE_HZ)
    held = np.clip(np.searchsorted(told["t_s"], t_s - lag_s, side="right") - 1, 0, None)
    share, curvature = ((1500.0 - told[name].to_numpy()[held]) / 600.0 for name in ("drive", "front"))
    steps = speed_mps * share / RATE_HZ
    course = course_rad + np.cumsum(steps * curvature)
    x_m, y_m = np.cumsum(steps * np.cos(course)), np.cumsum(steps * np.sin(course))
    return pd.DataFrame({"t_s": t_s, "x_m": x_m, "y_m": y_m, "heading_rad": course, "tracked": True})


def bench(
    speed_mps: float = 0.3,
    *,
    lag_s: float = 0.1,
    heading: Callable[[pd.Series], object] = lambda course: course,
    free: bool = False,
) -> dict[str, pd.DataFrame]:
    """Return a campaign of straights and quarter turns, forward and back, each with its target.

    With `free`, further commands follow at half speed, and there are no targets.
    """
    tables: dict[str, list[pd.DataFrame]] = {"runs": [], "commands": [], "poses": []}
    for k, (way, left) in enumerate([(1.5, 0.0), (-1.5, 0.0), (1.5, 1.0), (-1.5, 1.0)] * 2):
        name, front = f"r{k}", 1500.0 - 600.0 * left
        drive = 900.0 if way > 0.0 else 2100.0
        t_s = [0.0, 0.5, 0.5 + 1.5 / speed_mps]
        told = pd.DataFrame({"t_s": t_s, "drive": [1500.0, drive, 1500.0], "front": front, "rear": 1500.0})
        if free:
            more = [2.5 + 1.5 / speed_mps, 4.5 + 1.5 / speed_mps, 6.0 + 1.5 / speed_mps]
            drives = [1500.0 - 0.5 * (1500.0 - drive), 3000.0 - drive, 1500.0]
            told = pd.concat([told, told.assign(t_s=more, drive=drives, front=1500.0 + 300.0 * left)])
        poses = _drive(speed_mps, lag_s, 0.1 * k, told)
        target = (np.sin(way), 1.0 - np.cos(way), way) if left else (way, 0.0, 0.0)
        target = (np.nan,) * 3 if free else target
        run = dict(zip(("target_x_m", "target_y_m", "target_heading_rad"), target, strict=True))
        run |= {"experiment": "trajectory", "trajectory": "1", "condition": "calibrated", "repeat": 1}
        run |= {"started_s": 20.0 * k, "status": "ok", "firmware": "1"}
        poses["heading_rad"] = heading(poses["heading_rad"])
        for table, frame in (("runs", pd.DataFrame([run])), ("commands", told), ("poses", poses)):
            tables[table].append(frame.assign(run_id=name))
    return {table: pd.concat(frames, ignore_index=True) for table, frames in tables.items()}


def write(directory: Path, tables: dict[str, pd.DataFrame]) -> Path:
    """Write a campaign of single parquet files."""
    write_head(directory)
    for name, table in tables.items():
        table.to_parquet(directory / f"{name}.parquet", index=False)
    return directory
