"""Campaigns of vehicles that are commanded by two wheel speeds: recorded, read, checked and imported."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from campaign_samples import HEADER, MAPPING, make_run, recording, write_csv

from agvbench.campaign import Campaign, CampaignHeader, CampaignWriter, import_recordings
from agvbench.errors import CampaignError, FileError
from agvbench.types import Commands, Run
from agvbench.vehicle.channels import Channel, Channels
from agvbench.vehicle.wheels import Wheels

WHEELS = Wheels(Channel("si", 0.0, -0.6, 0.6), Channel("si", 0.0, -0.6, 0.6), track_m=0.4)


def wheels_header() -> CampaignHeader:
    return replace(HEADER, schema=4, kinematics="differential", front_axle_m=0.0, channels=Channels.of_wheels(WHEELS))


def wheel_run() -> Run:
    drive, front = WHEELS.body(np.array([0.2, -0.6, 0.0]), np.array([0.4, 0.6, 0.0]))
    return make_run("a", commands=Commands(np.array([0.0, 0.5, 1.0]), drive, front, np.zeros(3)))


def test_wheel_commands_are_recorded_and_read_as_speed_and_yaw_rate(tmp_path: Path) -> None:
    CampaignWriter.create(tmp_path / "c", wheels_header()).append(wheel_run())
    table = pq.read_table(tmp_path / "c/commands.parquet/a.parquet")
    assert table.column_names[:4] == ["run_id", "t_s", "left", "right"]
    np.testing.assert_allclose(table["left"], [0.2, -0.6, 0.0], atol=1e-15)
    campaign = Campaign.open(tmp_path / "c").check()
    assert campaign.header == wheels_header()
    np.testing.assert_allclose(campaign.run("a").commands.drive, [0.3, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(campaign.run("a").commands.front, [0.5, 3.0, 0.0], atol=1e-14)


def test_a_wheel_out_of_its_range_is_one_line(tmp_path: Path) -> None:
    CampaignWriter.create(tmp_path / "c", wheels_header()).append(wheel_run())
    path = tmp_path / "c/commands.parquet/a.parquet"
    table = pq.read_table(path)
    table = table.set_column(table.column_names.index("right"), "right", pa.array([0.4, 0.7, 0.0]))
    pq.write_table(table, path)
    (tmp_path / "c/SHA256SUMS").unlink()
    with pytest.raises(CampaignError, match=r"right is out of range: 0\.7 \(limit: -0\.6…0\.6\); correct it"):
        Campaign.open(tmp_path / "c").check()


WHEEL_CHANNELS = """[channels]
track_m = 0.4
left = { unit = "m/s", neutral = 0.0, low = -0.6, high = 0.6 }
right = { unit = "m/s", neutral = 0.0, low = -0.6, high = 0.6 }

[columns]
"""


def wheel_mapping(columns: str, channels: str = WHEEL_CHANNELS) -> str:
    """Return the mapping of a differential vehicle with these command columns."""
    lines = [line for line in MAPPING.splitlines() if not line.startswith(("drive =", "front =", "rear ="))]
    text = "\n".join(line for line in lines if not line.startswith(("command_unit", "neutral", "front_axle_m")))
    text = text.replace("[vehicle]\n", '[vehicle]\nkinematics = "differential"\n', 1)
    return text.replace("[columns]\n", channels + columns + "\n", 1)


def wheel_recording(tmp_path: Path) -> Path:
    table = recording()
    count = len(table["t"])
    table |= {"L": [20.0] * 30 + [-60.0] * (count - 30), "R": [40.0] * 30 + [60.0] * (count - 30)}
    return write_csv(tmp_path / "r.csv", table)


def test_a_recording_of_wheel_commands_is_imported(tmp_path: Path) -> None:
    columns = 'left = { column = "L", scale = 0.01 }\nright = { column = "R", scale = 0.01 }'
    (tmp_path / "mapping.toml").write_text(wheel_mapping(columns), encoding="utf-8")
    campaign = import_recordings(tmp_path / "mapping.toml", [wheel_recording(tmp_path)], tmp_path / "c")
    assert campaign.header.channels.wheels == WHEELS
    commands = next(iter(Campaign.open(tmp_path / "c"))).commands
    np.testing.assert_allclose(commands.t_s, [0.0, 0.3])
    np.testing.assert_allclose(commands.drive, [0.3, 0.0], atol=1e-12)
    np.testing.assert_allclose(commands.front, [0.5, 3.0], atol=1e-12)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ('left = { column = "L" }', r"a command column is missing: columns\.right; add \[columns\.right\]"),
        (
            'left = { column = "L" }\nright = { column = "R" }\ndrive = { column = "L" }',
            r"is no command of this vehicle: columns\.drive \(.*left, right\)",
        ),
        ('drive = { column = "L" }\nfront = { column = "R" }', r"a command column is missing: columns\.left"),
    ],
)
def test_a_mapping_with_other_commands_than_its_channels_is_one_line(
    tmp_path: Path, columns: str, message: str
) -> None:
    (tmp_path / "mapping.toml").write_text(wheel_mapping(columns), encoding="utf-8")
    with pytest.raises(FileError, match=message) as caught:
        import_recordings(tmp_path / "mapping.toml", [wheel_recording(tmp_path)], tmp_path / "c")
    assert "\n" not in str(caught.value)
