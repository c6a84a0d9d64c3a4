"""Bags are imported as they were written: poses and commands of every format and type."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ros_bags import BEGAN_NS, DIFFERENTIAL, KINDS, Sent, circle, command_ns, driven, write_bag

from agvbench.campaign import Campaign, import_recordings
from agvbench.cli import main
from agvbench.types import TimeSeries


def imported(folder: Path, sent: list[Sent], mapping: str = DIFFERENTIAL, *, kind: str = "mcap") -> Campaign:
    (folder / "mapping.toml").write_text(mapping, encoding="utf-8")
    return import_recordings(folder / "mapping.toml", [write_bag(folder, "monday", kind, sent)], folder / "c")


@pytest.mark.parametrize("kind", KINDS)
def test_poses_and_commands_are_those_that_were_written(kind: str, tmp_path: Path) -> None:
    campaign = imported(tmp_path, driven(), kind=kind)
    run = campaign.run("monday-001")
    truth = np.array(circle())
    np.testing.assert_allclose(run.frames.t_s, np.arange(60) / 50, atol=1e-9)
    np.testing.assert_array_equal(run.frames.x_m, truth[:, 1])
    np.testing.assert_array_equal(run.frames.y_m, truth[:, 2])
    np.testing.assert_allclose(run.frames.heading_rad, truth[:, 3], atol=1e-12)
    assert run.frames.tracked.all()
    # The command from before the first pose holds at 0; that after the last pose is no part of the run.
    given_s = np.array([(command_ns(number) - BEGAN_NS) * 1e-9 for number in range(21)])
    np.testing.assert_allclose(run.commands.t_s, np.maximum(given_s[given_s <= 59 / 50], 0.0), atol=1e-9)
    np.testing.assert_allclose(run.commands.drive, 0.5 + 0.01 * np.arange(len(run.commands)), atol=1e-12)
    np.testing.assert_array_equal(run.commands.front, 0.5)
    assert campaign.header.geometry.is_differential
    assert campaign.table("import")["used"].tolist() == [60]


POSES = {
    "pose_stamped": "",
    "pose_with_covariance": "",
    "odometry": "",
    "transform": "",
    "tf": 'child_frame_id = "base_link"\n',
}


@pytest.mark.parametrize("kind", ["sqlite3", "ros1"])
@pytest.mark.parametrize("pose", POSES)
def test_every_type_of_pose(pose: str, kind: str, tmp_path: Path) -> None:
    mapping = DIFFERENTIAL.replace("[columns]", POSES[pose] + "\n[columns]")
    run = next(iter(imported(tmp_path, driven(pose=pose), mapping, kind=kind)))
    truth = np.array(circle())
    np.testing.assert_array_equal(np.column_stack([run.frames.x_m, run.frames.y_m]), truth[:, 1:3])
    np.testing.assert_allclose(run.frames.heading_rad, truth[:, 3], atol=1e-12)


@pytest.mark.parametrize(("time", "late_s"), [("header", 0.0), ("received", 0.004)])
def test_the_time_is_the_stamp_or_that_of_recording(time: str, late_s: float, tmp_path: Path) -> None:
    mapping = DIFFERENTIAL.replace('clock = "absolute"', f'clock = "absolute"\ntime = "{time}"')
    run = next(iter(imported(tmp_path, driven(), mapping)))
    # The pose decides where the run begins, and so how long after that the second command was given.
    assert run.commands.t_s[1] == pytest.approx((command_ns(1) - BEGAN_NS) * 1e-9 - late_s, abs=1e-9)


def test_a_tracker_with_y_up(tmp_path: Path) -> None:
    def pose(make, ns: int, x: float, y: float, heading: float):
        turn = make("geometry_msgs/Quaternion", 0.0, math.sin(heading / 2), 0.0, math.cos(heading / 2))
        content = make("geometry_msgs/Pose", make("geometry_msgs/Point", x, 0.2, -y), turn)
        return make("geometry_msgs/PoseStamped", make.header(ns), content)

    commands = [message for message in driven() if message.topic == "/cmd_vel"]
    poses = [Sent(ns, "/pose", lambda make, ns=ns, p=p: pose(make, ns, *p)) for ns, *p in circle()]
    mapping = DIFFERENTIAL.replace("[columns]", 'floor_x = "x"\nfloor_y = "-z"\n\n[columns]')
    run = next(iter(imported(tmp_path, sorted(commands + poses, key=lambda m: m.ns), mapping)))
    np.testing.assert_array_equal(run.frames.y_m, np.array(circle())[:, 2])
    np.testing.assert_allclose(run.frames.heading_rad, np.array(circle())[:, 3], atol=1e-12)


def test_ackermann_commands_of_a_vehicle_with_a_steered_axle(tmp_path: Path) -> None:
    poses = [message for message in driven() if message.topic == "/pose"]
    drive = [
        Sent(ns, "/drive", lambda make, ns=ns, row=row: make.ackermann(ns, 0.5, row / 64))
        for row, (ns, *_) in enumerate(circle()[::10])
    ]
    mapping = (
        DIFFERENTIAL.replace('kinematics = "differential"', "front_axle_m = 0.2")
        .replace("rear_axle_m = 0.0", "rear_axle_m = 0.1")
        .replace('"/cmd_vel", column = "linear.x"', '"/drive", column = "drive.speed"')
        .replace('"/cmd_vel", column = "angular.z"', '"/drive", column = "drive.steering_angle", scale = 2.0')
    )
    campaign = imported(tmp_path, sorted(poses + drive, key=lambda m: m.ns), mapping)
    run = next(iter(campaign))
    np.testing.assert_allclose(run.commands.t_s, np.arange(6) * 0.2, atol=1e-9)
    np.testing.assert_allclose(run.commands.front, np.arange(6) / 32, atol=1e-12)
    np.testing.assert_array_equal(run.commands.rear, 0.0)


def test_numbers_of_own_types_by_their_paths(tmp_path: Path) -> None:
    sent = [
        Sent(ns, "/state", lambda make, row=row, p=p: make.custom(0.25, row / 16, *p))
        for row, (ns, *p) in enumerate(circle())
    ]
    mapping = (
        DIFFERENTIAL.replace('topic = "/pose"', 'topic = "/state"\nfield = "bodies.1"')
        .replace('"/cmd_vel", column = "linear.x"', '"/state", column = "wheels.0.speed"')
        .replace('"/cmd_vel", column = "angular.z"', '"/state", column = "wheels.1.speed"')
    )
    for kind in ("mcap", "ros1"):
        folder = tmp_path / kind
        folder.mkdir()
        run = next(iter(imported(folder, sent, mapping, kind=kind)))
        np.testing.assert_array_equal(run.commands.front, np.arange(60) / 16)
        np.testing.assert_array_equal(run.frames.x_m, np.array(circle())[:, 1])


def test_what_else_was_logged_is_that_of_its_topic(tmp_path: Path) -> None:
    volts = [
        Sent(circle()[row][0] - 1, "/volts", lambda make, v=v: make("std_msgs/Float64", v))
        for row, v in ((0, 12.0), (30, 11.5))
    ]
    mapping = DIFFERENTIAL + '\n[logged]\nbattery_V = { topic = "/volts", column = "data", time = "received" }\n'
    run = next(iter(imported(tmp_path, sorted(driven() + volts, key=lambda m: m.ns), mapping)))
    np.testing.assert_array_equal(run.logged["battery_V"].value, [12.0] * 30 + [11.5] * 30)


def test_a_flag_says_when_the_vehicle_drives_by_itself(tmp_path: Path) -> None:
    flags = [
        Sent(circle()[row][0] - 1, "/auto", lambda make, on=on: make("std_msgs/Bool", on))
        for row, on in ((10, True), (30, False), (40, True))
    ]
    mapping = DIFFERENTIAL.replace("[runs]", 'driven = { topic = "/auto", column = "data", equals = true }\n\n[runs]')
    campaign = imported(tmp_path, sorted(driven() + flags, key=lambda m: m.ns), mapping)
    assert [len(run.frames) for run in campaign] == [20, 20]
    assert campaign.table("import")["not_driven"].tolist() == [20]


def test_poses_before_the_first_command_are_not_driven_and_nan_is_not_seen(tmp_path: Path) -> None:
    sent = [message for message in driven() if message.topic == "/pose" or message.ns > circle()[20][0]]
    ns = circle()[40][0] + 1
    sent.append(Sent(ns, "/pose", lambda make: make.pose_stamped(ns, math.nan, 0.0, 0.0)))
    account = imported(tmp_path, sorted(sent, key=lambda m: m.ns)).table("import").iloc[0]
    assert account[["rows", "not_driven", "not_seen", "used"]].tolist() == [61, 23, 1, 37]


def test_stamps_that_are_out_of_order_by_a_little_are_sorted(tmp_path: Path) -> None:
    sent = driven()
    poses = [index for index, message in enumerate(sent) if message.topic == "/pose"]
    one, other = poses[10], poses[11]
    sent[one], sent[other] = sent[one]._replace(make=sent[other].make), sent[other]._replace(make=sent[one].make)
    run = next(iter(imported(tmp_path, sent)))
    np.testing.assert_array_equal(run.frames.x_m, np.array(circle())[:, 1])


def test_bags_are_placed_in_one_clock_and_hashed(tmp_path: Path) -> None:
    (tmp_path / "mapping.toml").write_text(DIFFERENTIAL.replace("[runs]", '[runs]\nsession = "day"'))
    later = [message._replace(ns=message.ns + 86_400 * 10**9) for message in driven()]
    later = [m for m in later if m.topic == "/cmd_vel"]
    later += [
        Sent(ns + 86_400 * 10**9, "/pose", lambda make, ns=ns, p=p: make.pose_stamped(ns + 86_400 * 10**9, *p))
        for ns, *p in circle()
    ]
    bags = [
        write_bag(tmp_path, "b.v2", "sqlite3", sorted(later, key=lambda m: m.ns)),
        write_bag(tmp_path, "a.v2", "mcap", driven()),
    ]
    campaign = import_recordings(tmp_path / "mapping.toml", bags, tmp_path / "c")
    assert campaign.runs["run_id"].tolist() == ["a.v2-001", "b.v2-001"]
    assert campaign.runs["session"].tolist() == ["2023-11-14", "2023-11-15"]
    assert campaign.runs["started_s"].tolist() == pytest.approx([0.0, 86400.0], abs=1e-6)
    assert campaign.table("import")["sha256"].nunique() == 2


TIMES = st.lists(st.integers(0, 4_000_000_000), min_size=2, max_size=12, unique=True).map(sorted)
NUMBERS = st.floats(-50.0, 50.0)


@settings(max_examples=40)
@given(
    poses_ns=TIMES, commands_ns=TIMES, numbers=st.lists(NUMBERS, min_size=24, max_size=24), kind=st.sampled_from(KINDS)
)
def test_each_pose_has_the_command_that_held_then(poses_ns, commands_ns, numbers, kind, tmp_path_factory):
    """What holds at any pose is the newest command until then, whatever their times and the format."""
    commands_ns = [commands_ns[0] - 5_000_000_000, *commands_ns[1:]]  # one comes before every pose
    values = numbers[: len(commands_ns)]
    sent = [
        Sent(BEGAN_NS + ns, "/pose", lambda make, ns=ns: make.pose_stamped(BEGAN_NS + ns, ns * 1e-9, 0.0, 0.0))
        for ns in poses_ns
    ]
    sent += [
        Sent(BEGAN_NS + ns, "/cmd_vel", lambda make, value=value: make.twist(value, 0.0))
        for ns, value in zip(commands_ns, values, strict=True)
    ]
    folder = tmp_path_factory.mktemp("bag")
    mapping = DIFFERENTIAL.replace("shortest_s = 0.1", "shortest_s = 0.0\ngap_s = 10.0")
    run = next(iter(imported(folder, sorted(sent, key=lambda m: m.ns), mapping, kind=kind)))
    np.testing.assert_allclose(run.frames.x_m, np.array(poses_ns) * 1e-9, atol=1e-12)
    held = TimeSeries(run.commands.t_s, run.commands.drive).held_at(run.frames.t_s + 1e-12)
    expected = [values[max(i for i, at in enumerate(commands_ns) if at <= ns)] for ns in poses_ns]
    np.testing.assert_array_equal(held, expected)


def test_the_command_line_imports_a_bag(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mapping.toml").write_text(DIFFERENTIAL, encoding="utf-8")
    bag = write_bag(tmp_path, "monday", "mcap", driven())
    assert main(["import", "--mapping", str(tmp_path / "mapping.toml"), f"{bag}/", "--out", str(tmp_path / "c")]) == 0
    out = capsys.readouterr().out
    assert "monday" in out
    assert "runs: 1, sessions: 1" in out
