"""Guessed mappings of bags and TUM files: the recording is imported as it was driven, and the rest is asked."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from campaign_samples import write_csv
from ros_bags import Sent, circle, driven, write_bag

from agvbench.campaign import Campaign, import_recordings
from agvbench.campaign.recordings.guess import guess_mapping
from agvbench.cli import main


def guessed(folder: Path, recording: Path) -> tuple[Campaign, str, list[str]]:
    text, questions = guess_mapping(recording)
    (folder / "mapping.toml").write_text(text.replace("shortest_s = 2.0", "shortest_s = 0.1"), encoding="utf-8")
    return import_recordings(folder / "mapping.toml", [recording], folder / "c"), text, questions


def sent_with(*more: Sent, pose: str = "pose_stamped", without: str = "") -> list[Sent]:
    messages = [message for message in driven(pose=pose) if message.topic != without]
    return sorted([*messages, *more], key=lambda message: message.ns)


def numbers(topic: str, scale: float = 1.0) -> list[Sent]:
    return [
        Sent(ns - 1, topic, lambda make, row=row: make.number(scale * np.sin(row / 5)))
        for row, (ns, *_) in enumerate(circle())
    ]


@pytest.mark.parametrize("kind", ["sqlite3", "ros1"])
@pytest.mark.parametrize("pose", ["pose_stamped", "odometry", "tf", "pose_with_covariance"])
def test_a_differential_vehicle_with_cmd_vel(pose, kind, tmp_path):
    campaign, _, questions = guessed(tmp_path, write_bag(tmp_path, "monday", kind, sent_with(pose=pose)))
    (run,) = list(campaign)
    np.testing.assert_array_equal(run.frames.x_m, np.array(circle())[:, 1])
    assert campaign.header.geometry.is_differential
    assert campaign.header.mocap_rate_hz == pytest.approx(50.0, rel=1e-6)
    assert any(question.startswith("rear_axle_m") for question in questions)
    assert any("Odometry of wheels" in question for question in questions) is (pose == "odometry")
    assert any("the vehicle is base_link, or one of laser?" in question for question in questions) is (pose == "tf")


def test_an_ackermann_vehicle(tmp_path):
    drive = [Sent(ns - 1, "/drive", lambda make, ns=ns: make.ackermann(ns, 0.5, 0.1)) for ns, *_ in circle()]
    bag = write_bag(tmp_path, "monday", "mcap", sent_with(*drive, without="/cmd_vel"))
    campaign, text, questions = guessed(tmp_path, bag)
    assert 'front = { topic = "/drive", column = "drive.steering_angle" }' in text
    assert not campaign.header.geometry.is_differential
    assert campaign.header.channels.drive.unit == "si"
    assert any(question.startswith("front_axle_m, rear_axle_m") for question in questions)


def test_numbers_are_commands_by_the_names_of_their_topics(tmp_path):
    more = [m for name in ("drive", "steering_front", "steering_rear") for m in numbers(f"/pwm/{name}")]
    campaign, text, _ = guessed(tmp_path, write_bag(tmp_path, "monday", "mcap", sent_with(*more, without="/cmd_vel")))
    assert 'rear = { topic = "/pwm/steering_rear", column = "data" }' in text
    assert campaign.header.channels.drive.unit == "normalised"
    run = next(iter(campaign))
    np.testing.assert_allclose(run.commands.rear[:10], np.sin(np.arange(10) / 5), atol=1e-12)


def test_what_the_topics_leave_open_is_asked(tmp_path):
    zero = [Sent(ns, "/teleop_cmd", lambda make: make.twist_stamped(0, 0.5, 0.5)) for ns, *_ in circle()]
    sideways = [
        Sent(ns, "/pose", lambda make, ns=ns, p=p: make.pose_stamped(ns, p[0], p[1], p[2] + 1.5)) for ns, *p in circle()
    ]
    odometry = [Sent(ns, "/odom", lambda make, ns=ns, p=p: make.odometry(ns, *p)) for ns, *p in circle()]
    sent = sorted([*zero, *sideways, *odometry], key=lambda message: message.ns)
    _, text, questions = guessed(tmp_path, write_bag(tmp_path, "monday", "mcap", sent))
    assert "pose: /pose, or /odom?" in questions
    assert "pose: the heading does not follow the direction of travel; which axis is forward?" in questions
    assert "/teleop_cmd: its headers have no stamps; is the time of recording good enough?" in questions
    assert 'time = "received"' in text


def test_the_command_lists_the_topics(tmp_path, capsys):
    bag = write_bag(tmp_path, "monday", "sqlite3", driven())
    assert main(["import", "--guess", str(bag), "--out", str(tmp_path / "mapping.toml")]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[0].startswith("/cmd_vel  geometry_msgs/msg/Twist, 21 messages, ")
    assert printed[1].startswith("/pose     geometry_msgs/msg/PoseStamped, 60 messages, ")
    assert f"# {printed[0]}" in (tmp_path / "mapping.toml").read_text(encoding="utf-8").splitlines()


def test_a_tum_file_with_its_commands(tmp_path):
    rows = [(ns * 1e-9 - 1.7e9, *pose) for ns, *pose in circle()]
    lines = [
        f"{t:.9f} {x!r} {y!r} 0 0 0 {math.sin(h / 2)!r} {math.cos(h / 2)!r}" for t, x, y, h in np.array(rows).tolist()
    ]
    (tmp_path / "monday.tum").write_text("# t x y z qx qy qz qw\n" + "\n".join(lines) + "\n")
    commands = {"t_s": [0.0, 0.5, 1.0], "cmd_v": [0.5, 0.5, 0.6], "cmd_w": [0.5, 0.4, 0.5], "enabled": [1, 1, 0]}
    write_csv(tmp_path / "monday.csv", commands)
    campaign, _, questions = guessed(tmp_path, tmp_path / "monday.tum")
    (run,) = list(campaign)
    assert len(run.frames) == sum(t < 1.0 for t, *_ in rows)
    np.testing.assert_allclose(run.frames.x_m, np.array(rows)[: len(run.frames), 1])
    np.testing.assert_allclose(run.frames.heading_rad, np.array(rows)[: len(run.frames), 3])
    np.testing.assert_allclose(run.commands.t_s, [0.0, 0.5 - rows[0][0]], atol=1e-9)
    np.testing.assert_array_equal(run.commands.front, [0.5, 0.4])
    assert "enabled: do only rows with 1 count as driven?" in questions
    assert campaign.header.geometry.is_differential
