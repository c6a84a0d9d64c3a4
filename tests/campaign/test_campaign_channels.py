"""Campaigns whose channels are described one by one: read, checked, recorded and imported (schema 4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from campaign_samples import (
    HEADER,
    MAPPING,
    assert_same_run,
    head,
    make_run,
    tables,
    write_campaign,
    write_csv,
    write_head,
)

from agvbench.campaign import Campaign, CampaignHeader, CampaignWriter, import_recordings
from agvbench.campaign.recordings.guess import guess_mapping
from agvbench.cli import main
from agvbench.errors import CampaignError
from agvbench.types import Commands
from agvbench.vehicle.channels import Channel, Channels

CHANNELS = {
    "drive": {"unit": "normalised", "neutral": 0.0, "low": -1.0, "high": 1.0},
    "front": {"unit": "normalised", "neutral": 0.5, "low": 0.0, "high": 1.0},
    "rear": {"unit": "rad", "neutral": 0.0, "low": -0.6, "high": 0.6},
}
MIXED = Channels(
    Channel("normalised", 0.0, -1.0, 1.0), Channel("normalised", 0.5, 0.0, 1.0), Channel("si", 0.0, -0.6, 0.6)
)
ROBOT = Channels(Channel("si", 0.0, -1.0, 1.0), *[Channel("normalised", 0.5, 0.0, 1.0)] * 2)


def mixed_head(**changed: object) -> dict[str, Any]:
    """Return a head of schema 4, some of its top level changed; None deletes."""
    toml = head()
    for key in ("command_unit", "neutral"):
        del toml["vehicle"][key]
    toml |= {"schema": 4, "channels": CHANNELS} | changed
    return {key: value for key, value in toml.items() if value is not None}


def mixed_tables() -> dict[str, dict[str, list[Any]]]:
    """Return a sound campaign in these channels."""
    columns = tables()
    columns["commands"] |= {
        "drive": [0.4, 0.0, 0.35, 0.0], "front": [0.5, 0.5, 0.1, 0.5], "rear": [0.0, 0.0, 0.2, 0.0],
    }  # fmt: skip
    return columns


def write(directory: Path, toml: dict[str, Any], columns: dict[str, dict[str, list[Any]]], suffix: str) -> Path:
    if suffix == ".parquet":
        write_campaign(directory, columns)
    else:
        directory.mkdir()
        for name, table in columns.items():
            write_csv(directory / f"{name}.csv", table)
    return write_head(directory, toml)


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_a_campaign_of_unlike_channels_is_read(tmp_path: Path, suffix: str) -> None:
    campaign = Campaign.open(write(tmp_path / "c", mixed_head(), mixed_tables(), suffix)).check()
    assert campaign.header.channels == MIXED
    assert campaign.header.neutral == (0.0, 0.5, 0.0)
    np.testing.assert_array_equal(campaign.run("b").commands.front, [0.1, 0.5])


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_a_differential_vehicle_has_a_speed_and_a_yaw_rate(tmp_path: Path, suffix: str) -> None:
    columns = tables()
    columns["commands"] = {
        "run_id": ["a", "a", "b", "b"], "t_s": [0.0, 1.0, 0.0, 1.0],
        "speed": [0.4, 0.0, 0.3, 0.0], "yaw_rate": [0.5, 0.5, 0.9, 0.5], "drive": [9.0, 9.0, 9.0, 9.0],
    }  # fmt: skip
    names = {"speed": {**CHANNELS["drive"], "unit": "m/s"}, "yaw_rate": CHANNELS["front"]}
    vehicle = {"name": "turtle", "rear_axle_m": 0.1, "kinematics": "differential"}
    toml = mixed_head(channels=names, vehicle=vehicle)
    campaign = Campaign.open(write(tmp_path / "c", toml, columns, suffix)).check()
    assert campaign.header.channels == ROBOT
    commands = campaign.run("b").commands
    np.testing.assert_array_equal([commands.drive, commands.front, commands.rear], [[0.3, 0.0], [0.9, 0.5], [0.5, 0.5]])


@pytest.mark.parametrize(
    ("header", "columns"),
    [
        (replace(HEADER, schema=4, channels=MIXED), ["run_id", "t_s", "drive", "front", "rear"]),
        (
            replace(HEADER, schema=4, front_axle_m=0.0, kinematics="differential", channels=ROBOT),
            ["run_id", "t_s", "speed", "yaw_rate"],
        ),
    ],
    ids=["two axles", "differential"],
)
def test_what_is_recorded_is_read_as_it_was_and_written_alike_again(
    tmp_path: Path, header: CampaignHeader, columns: list[str]
) -> None:
    rng = np.random.default_rng(1)
    rear = rng.uniform(-0.6, 0.6, 5) if header.kinematics == "two_axle" else np.full(5, 0.5)
    commands = Commands(np.arange(5) / 10.0, rng.uniform(-1.0, 1.0, 5), rng.uniform(0.0, 1.0, 5), rear)
    run = make_run("a", commands=commands)
    CampaignWriter.create(tmp_path / "one", header).append(run)
    assert pq.read_table(tmp_path / "one" / "commands.parquet" / "a.parquet").column_names == columns
    again = Campaign.open(tmp_path / "one")
    assert again.header == header
    assert_same_run(again.run("a"), run)
    CampaignWriter.create(tmp_path / "two", again.header).append(again.run("a"))
    assert (tmp_path / "one" / "SHA256SUMS").read_bytes() == (tmp_path / "two" / "SHA256SUMS").read_bytes()


def test_alike_channels_are_written_in_the_schema_that_knew_them(tmp_path: Path) -> None:
    HEADER.save(tmp_path / "campaign.toml")
    text = (tmp_path / "campaign.toml").read_text()
    assert "schema = 1" in text
    assert 'command_unit = "us"\nneutral = 1500.0\n' in text
    assert "channels" not in text


def _channel(name: str, **changed: object) -> dict[str, Any]:
    table = {key: value for key, value in {**CHANNELS[name], **changed}.items() if value is not None}
    return mixed_head(channels={**CHANNELS, name: table})


@pytest.mark.parametrize(
    ("toml", "line"),
    [
        (mixed_head(schema=3), "[channels] needs a newer schema: [channels] in schema 3"),
        (mixed_head(channels=None), "vehicle: key 'command_unit' is missing"),
        (_channel("front", low=1.0), "channels.front.low: is not below high: 1 (limit: below 1)"),
        (_channel("front", neutral=1.5), "channels.front.neutral: is out of range: 1.5 (limit: 0…1)"),
        (_channel("rear", unit="m/s"), "channels.rear.unit: unknown unit: 'm/s' (one of: us, normalised, rad)"),
        (_channel("rear", high=None), "channels.rear: a key is missing: high"),
        (_channel("rear", hihg=1.0), "channels.rear: unknown key: hihg; did you mean high?"),
        (_channel("drive", low="slow"), "channels.drive.low: must be a number: 'slow'"),
        (mixed_head(channels={"drive": CHANNELS["drive"]}), "channels.front: a table is missing"),
        (mixed_head(channels=0.5), "channels: value cannot be used: 0.5"),
        (mixed_head(vehicle=head()["vehicle"]), "command_unit: the channels are described twice"),
        (
            mixed_head(vehicle={"name": "t", "rear_axle_m": 0.1, "kinematics": "differential"}),
            "channels: unknown key: drive",
        ),
    ],
)
def test_a_head_that_cannot_be_is_refused_in_one_line(
    tmp_path: Path, toml: dict[str, Any], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path / "c", toml, mixed_tables(), ".parquet")
    assert main(["calibrate", str(path)]) == 2
    said = capsys.readouterr().err
    assert f"{path / 'campaign.toml'}: {line}" in said.replace("\n", " ")
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("column", "value", "limit"), [("drive", 1.01, "-1…1"), ("front", -0.01, "0…1"), ("rear", 1500.0, "-0.6…0.6")]
)
def test_a_command_out_of_its_range_is_refused(tmp_path: Path, column: str, value: float, limit: str) -> None:
    columns = mixed_tables()
    columns["commands"][column][2] = value
    path = write(tmp_path / "c", mixed_head(), columns, ".parquet")
    with pytest.raises(CampaignError) as raised:
        Campaign.open(path).check()
    place = f"{path / 'commands.parquet'}: run b: row 1"
    remedy = f"correct it, or [channels.{column}] of campaign.toml"
    assert str(raised.value) == f"{place}: {column} is out of range: {value:g} (limit: {limit}); {remedy}"


def test_a_missing_column_is_named_as_the_file_has_it(tmp_path: Path) -> None:
    vehicle = {"name": "turtle", "rear_axle_m": 0.1, "kinematics": "differential"}
    names = {"speed": CHANNELS["drive"], "yaw_rate": CHANNELS["front"]}
    path = write(tmp_path / "c", mixed_head(channels=names, vehicle=vehicle), mixed_tables(), ".csv")
    with pytest.raises(CampaignError, match="has no column speed"):
        Campaign.open(path).check()


def recording(path: Path, change: Callable[[dict[str, np.ndarray]], None] = lambda _: None) -> Path:
    """Write a figure eight: pulses to the motor, and a steering of 0…1."""
    t = np.arange(1000) / 50.0
    steer = np.sin(0.6 * t)
    heading = np.cumsum(0.8 * steer) / 50.0
    columns = {
        "t_s": t, "x_m": np.cumsum(0.5 * np.cos(heading)) / 50.0, "y_m": np.cumsum(0.5 * np.sin(heading)) / 50.0,
        "heading_rad": heading, "throttle": 1600.0 + 50.0 * np.sin(t), "steering": 0.5 + 0.4 * steer,
    }  # fmt: skip
    change(columns)
    return write_csv(path, {name: values.tolist() for name, values in columns.items()})


def test_a_mapping_gives_each_channel_its_own_neutral_and_range(tmp_path: Path) -> None:
    heads = MAPPING.replace('command_unit = "us"\nneutral = 1500.0\n', "")
    tables_ = "\n".join(
        f'[channels.{name}]\nunit = "{unit}"\nneutral = {neutral}\nlow = {low}\nhigh = {high}\n'
        for name, unit, neutral, low, high in (
            ("drive", "us", 1500.0, 1000.0, 2000.0), ("front", "normalised", 0.5, 0.0, 1.0),
            ("rear", "rad", 0.0, -0.5, 0.5),
        )
    )  # fmt: skip
    start, _, _ = heads.partition("[columns]")
    columns = """[columns]
time = { column = "t_s", unit = "s" }
x = { column = "x_m", unit = "m" }
y = { column = "y_m", unit = "m" }
heading = { column = "heading_rad", unit = "rad" }
drive = { column = "throttle" }
front = { column = "steering" }
"""
    (tmp_path / "mapping.toml").write_text(start + tables_ + columns)
    campaign = import_recordings(tmp_path / "mapping.toml", [recording(tmp_path / "r.csv")], tmp_path / "c")
    assert campaign.header.schema == 4
    assert campaign.header.neutral == (1500.0, 0.5, 0.0)
    (run,) = campaign
    assert 0.0 < run.commands.front.min() < 0.15
    assert not run.commands.rear.any()


def test_a_guess_gives_steering_from_0_to_1_its_own_channel(tmp_path: Path) -> None:
    path = recording(tmp_path / "r.csv")
    text, questions = guess_mapping(path)
    assert any(question.startswith("steering: never negative") for question in questions)
    (tmp_path / "mapping.toml").write_text(text, encoding="utf-8")
    header = import_recordings(tmp_path / "mapping.toml", [path], tmp_path / "c").header
    assert header.neutral == (1500.0, 0.5, 0.5)
    assert (header.channels.drive.unit, header.channels.front) == ("us", Channel("normalised", 0.5, 0.0, 1.0))
