"""Write the saved campaigns of a schema: run once for each schema, and keep what it wrote for ever.

``python tests/campaign/make_schema_data.py tests/campaign/data/schema_1``
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from agvbench.campaign import Campaign, CampaignHeader, CampaignWriter
from agvbench.types import NO_TARGET, Commands, Frames, Pose, Run
from agvbench.vehicle.channels import Channel, Channels

COUNT = 12
_MIXED = Channels(
    Channel("normalised", 0.0, -1.0, 1.0), Channel("us", 1400.0, 1000.0, 2000.0), Channel("si", 0.0, -0.6, 0.6)
)
_PREDICTION = {"prediction_horizon_s": 1.0, "prediction_stride_s": 0.5}
HEADS = {
    "schema_1": CampaignHeader(1, "saved", "thesis", 0.11, 0.09, Channels.alike("us"), 120.0, **_PREDICTION),
    "schema_2": CampaignHeader(2, "saved", "pusher", 0.11, 0.09, Channels.alike("us"), 120.0, driven="rear"),
    "schema_3": CampaignHeader(3, "saved", "robot", 0.0, 0.09, Channels.alike("si"), 50.0, kinematics="differential"),
    "schema_4": CampaignHeader(4, "saved", "mixed", 0.11, 0.09, _MIXED, 120.0),
}
"""By the name of the directory that the campaigns are saved in."""
_IN_US = [1900.0, 1850.0, 1500.0], [1400.0] * 3, [1600.0] * 3
COMMANDS = {
    "schema_1": _IN_US,
    "schema_2": _IN_US,
    "schema_3": ([0.8, 0.7, 0.0], [-0.5] * 3, [0.0] * 3),
    "schema_4": ([0.8, 0.7, 0.0], [1300.0] * 3, [0.2] * 3),
}
"""Drive, front and rear."""


def saved_runs(schema: str) -> list[Run]:
    """Return three runs whose every number follows from its row."""
    row = np.arange(COUNT, dtype=np.float64)
    tracked = np.arange(COUNT) != 5
    heading = np.where(row < 8, 3.0 + 0.02 * row, 3.0 + 0.02 * row - 2.0 * np.pi)
    x_m, y_m, heading_rad = (np.where(tracked, values, np.nan) for values in (0.25 * row, -0.5 * row, heading))
    x_m[9] = 40.0  # a tracker that jumps metres for a frame
    t_s = row / 4.0 - 0.5
    t_s[[3, 4]] = t_s[[4, 3]]  # a late frame
    frames = Frames(t_s, x_m, y_m, heading_rad, tracked, np.arange(COUNT) + 100, 1e-4 * row, t_s + 0.01)
    commands = Commands(np.array([0.0, 1.0, 2.5]), *np.array(COMMANDS[schema]))
    target = Pose(2.0, 0.0, 0.0)
    first = Run("trajectory-1-r1", "trajectory", "1", "calibrated", 1, target, 0.0, "ok", "1.0", commands, frames)
    first = replace(first, session="monday", split="fit", extra={"battery_v": 7.5})
    again = replace(
        first, run_id="trajectory-1-r2", repeat=2, started_s=30.0, status="rejected: start pose", split=None
    )
    nothing = replace(commands, **{name: getattr(commands, name)[:0] for name in ("t_s", "drive", "front", "rear")})
    gone = replace(first, run_id="drive 1850 µs", experiment="drive", trajectory="", condition="", repeat=0, extra={})
    gone = replace(gone, target=NO_TARGET, started_s=60.0, status="aborted: vehicle gone", split="held_out")
    return [first, again, replace(gone, commands=nothing, frames=Frames.empty())]


def main(directory: Path) -> None:
    """Write the same campaign as parts, as parquet files and as CSV; the directory's name says in which schema."""
    header = HEADS[directory.name]
    writer = CampaignWriter.create(directory / "parts", header)
    for run in saved_runs(directory.name):
        writer.append(run)
    writer.write_table("events", pd.DataFrame({"t_s": [60.5], "what": ["vehicle gone"]}))
    campaign = Campaign.open(directory / "parts")
    for form in ("parquet", "csv"):
        (directory / form).mkdir()
        header.save(directory / form / "campaign.toml")
        for name in ("runs", "commands", "poses"):
            table: pd.DataFrame = getattr(campaign, name)
            path = directory / form / f"{name}.{form}"
            table.to_csv(path, index=False) if form == "csv" else table.to_parquet(path, index=False)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
