"""The shipped mapping on the measured DART recordings; the figures were read off them with other tools."""

from __future__ import annotations

import csv
import os
from pathlib import Path

import numpy as np
import pytest

from agvbench.campaign import Campaign, import_recordings
from agvbench.vehicle.channels import Channels

MEASURED = Path(os.environ.get("AGVBENCH_MEASURED", Path(__file__).resolve().parents[3] / "shared" / "measured"))
FILES = sorted((MEASURED / "dart").glob("*.csv"))
pytestmark = pytest.mark.skipif(not FILES, reason=f"no DART recordings in {MEASURED}: set AGVBENCH_MEASURED")


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    return import_recordings("dart", FILES, tmp_path_factory.mktemp("dart") / "c")


def test_only_driven_rows_come_in_and_every_row_is_counted(campaign: Campaign) -> None:
    account = campaign.table("import").set_index("file")
    for file in FILES:
        with file.open(newline="") as stream:
            driven = [float(row["safety_value"]) == 1.0 for row in csv.DictReader(stream)]
        row = account.loc[file.name]
        assert row["rows"] == len(driven)
        assert row["not_driven"] == driven.count(False)
        assert row[["not_driven", "not_seen", "jumped", "too_short", "used"]].sum() == row["rows"]
    assert account["jumped"].drop("racetrack_lap.csv").sum() == 0


def test_the_object_that_the_tracker_held_for_14_s_is_not_the_car(campaign: Campaign) -> None:
    # It lies still at (−4.97, −0.79) in rows 407 to 1441 and 1448 to 1754, and for one frame at row 3516.
    lap = [run for run in campaign if run.run_id.startswith("racetrack_lap")]
    near = [np.hypot(run.frames.x_m + 4.972, run.frames.y_m + 0.79).min() for run in lap]
    assert campaign.table("import").set_index("file").loc["racetrack_lap.csv", "jumped"] == 1035 + 307 + 1 + 1
    assert np.nanmin(near) > 0.5


def test_no_run_moves_faster_than_the_car_can(campaign: Campaign) -> None:
    for run in campaign:
        seen = run.frames.select(run.frames.tracked)
        metres, seconds = np.hypot(np.diff(seen.x_m), np.diff(seen.y_m)), np.diff(seen.t_s)
        assert (metres <= 3.0 * seconds + 0.02).all()
        assert run.frames.tracked[[0, -1]].all()
        assert 1.5 <= run.frames.t_s[-1] <= 20.0


def test_sessions_are_days_and_the_head_describes_the_car(campaign: Campaign) -> None:
    assert campaign.runs["session"].unique().tolist() == ["2024-07-19", "2024-09-16", "2024-09-25"]
    header = campaign.header
    assert header.front_axle_m + header.rear_axle_m == pytest.approx(0.175)
    assert (header.channels, header.prediction_horizon_s) == (Channels.alike("normalised"), 2.0)
    assert (campaign.commands["rear"] == 0.0).all()
    assert campaign.commands["front"].abs().max() == pytest.approx(1.0)


def test_commands_are_held_for_a_tenth_of_a_second(campaign: Campaign) -> None:
    held = np.concatenate([np.diff(run.commands.t_s) for run in campaign if len(run.commands) > 20])
    assert np.median(held) == pytest.approx(0.1, abs=0.002)
    assert campaign.runs["command_hold_s"].unique().tolist() == [0.1]


def test_the_marker_body_is_ahead_of_the_rear_axle_by_about_what_the_mapping_says(campaign: Campaign) -> None:
    # Without slip the rear axle moves along the body: the marker's sideways speed is its lever arm times the yaw rate.
    sideways, yaw_rate = [], []
    for run in campaign:
        if not run.run_id.startswith("steering_sweep"):
            continue
        frames = run.frames
        step = 20
        t_s, heading = frames.t_s, np.unwrap(frames.heading_rad)
        seconds = t_s[step:] - t_s[:-step]
        middle = heading[step // 2 : -step // 2]
        vx = (frames.x_m[step:] - frames.x_m[:-step]) / seconds
        vy = (frames.y_m[step:] - frames.y_m[:-step]) / seconds
        sideways.append(-np.sin(middle) * vx + np.cos(middle) * vy)
        yaw_rate.append((heading[step:] - heading[:-step]) / seconds)
    slope = np.polyfit(np.concatenate(yaw_rate), np.concatenate(sideways), 1)[0]
    assert slope == pytest.approx(campaign.header.rear_axle_m, abs=0.02)
