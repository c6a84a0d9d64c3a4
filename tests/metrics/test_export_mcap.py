"""Exported bags: read by the library of the MCAP format, and imported again as they were."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from own_campaigns import line_campaign

from agvbench.campaign import Campaign, CampaignHeader, CampaignWriter, import_recordings
from agvbench.campaign.header import schema_for
from agvbench.cli import main
from agvbench.errors import FileError
from agvbench.statistics.rest_poses import start_pose
from agvbench.types import Commands, Frames, Pose, Run
from agvbench.vehicle.channels import Channel, Channels
from agvbench.vehicle.wheels import Wheels
from agvbench.workflows.exchange.export_mcap import MAPPING_FILE, export_mcap

SI = Channels.alike("si")
MIXED = Channels(Channel("us", 1500.0, 1000.0, 2000.0), *[Channel("normalised", 0.5, 0.0, 1.0)] * 2)
HEADERS = {
    "two axles": CampaignHeader(1, "lab", "mule", 0.11, 0.09, Channels.alike("us"), 100.0),
    "channels": CampaignHeader(4, "lab", "mule", 0.11, 0.09, MIXED, 100.0, 2.0, 1.0),
    "differential": CampaignHeader(3, "lab", "rover", 0.0, 0.05, SI, 100.0, kinematics="differential"),
    "wheels": CampaignHeader(
        3, "lab", "rover", 0.0, 0.05, Channels.alike("normalised"), 100.0, kinematics="differential"
    ),
}


def a_run(header: CampaignHeader, frames: np.ndarray, commands: np.ndarray, **changes) -> Run:
    """Return a run of frames (t, x, y, heading; NaN is lost) and commands (t, drive, front, rear)."""
    tracked = np.isfinite(frames[:, 1])
    unknown = np.full(len(frames), np.nan)
    if header.geometry.is_differential:
        commands[:, 3] = header.neutral.rear
    values = {
        "run_id": "free/1", "experiment": "free", "trajectory": "", "condition": "", "repeat": 0,
        "target": Pose(np.nan, np.nan, np.nan), "started_s": 12.5, "status": "ok", "firmware": "2", "session": "noon",
        "commands": Commands(*commands.T),
        "frames": Frames(*frames.T, tracked, np.full(len(frames), -1), unknown, unknown),
    }  # fmt: skip
    return Run(**(values | changes))


def write(path, header: CampaignHeader, *runs: Run) -> Campaign:
    writer = CampaignWriter.create(path, header, durable=False)
    for run in runs:
        writer.append(run)
    return Campaign.open(path)


def again(folder) -> Campaign:
    """Export the campaign in ``folder/camp`` and import it again."""
    export_mcap(folder / "camp", folder / "mcap")
    bags = sorted(path for path in (folder / "mcap").iterdir() if path.is_dir())
    return import_recordings(folder / "mcap" / MAPPING_FILE, bags, folder / "again")


def assert_same(imported: Run, run: Run, neutral) -> None:
    """Compare the tracked poses and the commands, up to when the time of the run begins."""
    tracked = run.frames.tracked
    first_s = run.frames.t_s[tracked][0]
    np.testing.assert_allclose(imported.frames.t_s, run.frames.t_s[tracked] - first_s, atol=2e-9)
    np.testing.assert_array_equal(imported.frames.x_m, run.frames.x_m[tracked])
    np.testing.assert_array_equal(imported.frames.y_m, run.frames.y_m[tracked])
    turned = np.exp(1j * imported.frames.heading_rad) / np.exp(1j * run.frames.heading_rad[tracked])
    np.testing.assert_allclose(turned, 1.0, atol=1e-12)
    commands = np.column_stack([run.commands.t_s - first_s, run.commands.drive, run.commands.front, run.commands.rear])
    if first_s < 0.0:
        commands = np.vstack([[0.0, *neutral], commands])
    commands = commands[commands[:, 0] <= imported.frames.t_s[-1] + 2e-9]
    changed = np.r_[True, np.any(np.diff(commands[:, 1:], axis=0) != 0.0, axis=1)]
    got = imported.commands
    np.testing.assert_allclose(got.t_s, np.maximum(commands[changed, 0], 0.0), atol=2e-9)
    np.testing.assert_array_equal(np.column_stack([got.drive, got.front, got.rear]), commands[changed, 1:])


def test_a_run_with_rest_and_target(tmp_path):
    line_campaign(tmp_path / "camp")
    (imported,) = list(again(tmp_path))
    original = Campaign.open(tmp_path / "camp")
    assert_same(imported, original.run("trajectory/1"), original.header.neutral)
    assert (imported.experiment, imported.trajectory, imported.condition) == ("trajectory", "1", "calibrated")


SMALL = st.floats(-20.0, 20.0)
TIMES = st.lists(st.integers(0, 50_000), min_size=2, max_size=12, unique=True).map(sorted)


@settings(max_examples=40)
@given(
    kind=st.sampled_from(list(HEADERS)),
    frames_ms=TIMES,
    commands_ms=TIMES,
    before_ms=st.integers(0, 900),
    numbers=st.lists(SMALL, min_size=36, max_size=36),
    lost=st.sets(st.integers(1, 10)),
)
@pytest.mark.slow
def test_export_and_import_give_the_same_poses_and_commands(
    kind, frames_ms, commands_ms, before_ms, numbers, lost, tmp_path_factory
):
    header, folder = HEADERS[kind], tmp_path_factory.mktemp("round")
    pool = np.array(numbers).reshape(12, 3)
    frames_s = (np.array(frames_ms) - frames_ms[0] - before_ms) * 1e-3
    poses = pool[: len(frames_s)] * [1.0, 1.0, 0.15]
    poses[[row for row in lost if row < len(poses) - 1]] = np.nan
    # Within the range of every unit, for a campaign rejects the others.
    share = np.abs(pool) / 20.0
    low, high = (np.array([getattr(c, name) if c.is_bounded else default for c in _channels(header)])
                 for name, default in (("low", 1000.0 if kind == "two axles" else -1.0),
                                       ("high", 2000.0 if kind == "two axles" else 1.0)))  # fmt: skip
    commands_s = (np.array(commands_ms) - commands_ms[0]) * 1e-3
    commands = np.column_stack([commands_s, (low + share * (high - low))[: len(commands_s)]])
    run = a_run(header, np.column_stack([frames_s, poses]), commands)
    write(folder / "camp", header, run)
    campaign = again(folder)
    (imported,) = list(campaign)
    assert_same(imported, run, header.neutral)
    assert (imported.session, imported.firmware) == ("noon", "2")
    assert campaign.header.channels == header.channels
    assert campaign.header.geometry == header.geometry


@pytest.mark.parametrize(
    "wheels",
    [
        Wheels(Channel("si", 0.0, -1.0, 1.0), Channel("si", 0.0, -1.0, 1.0), track_m=0.3),
        Wheels(Channel("us", 1500.0, 1000.0, 2000.0), Channel("us", 1480.0, 1000.0, 2000.0)),
    ],
)
def test_commands_of_two_wheels_are_exported_and_imported_as_such(tmp_path, wheels):
    header = CampaignHeader(
        schema_for("both", "differential", Channels.of_wheels(wheels)), "lab", "rover", 0.0, 0.05,
        Channels.of_wheels(wheels), 100.0, kinematics="differential",
    )  # fmt: skip
    t_s = np.arange(0.0, 3.0, 0.01)
    frames = np.column_stack([t_s, 0.1 * t_s, 0.0 * t_s, 0.0 * t_s])
    share = np.array([[0.0, 0.2, 0.1], [1.0, -0.1, 0.3], [2.0, 0.0, 0.0]])
    scale = 1.0 if wheels.unit == "si" else 500.0
    run = a_run(header, frames, np.column_stack([share[:, 0], scale * share[:, 1:], np.zeros(3)]))
    write(tmp_path / "camp", header, run)
    campaign = again(tmp_path)
    (imported,) = list(campaign)
    assert campaign.header.channels == header.channels
    np.testing.assert_allclose(imported.commands.drive, run.commands.drive, atol=1e-9)
    np.testing.assert_allclose(imported.commands.front, run.commands.front, atol=1e-9)
    topics = decoded(next((tmp_path / "mcap").rglob("*.mcap")))
    assert {"/command/left", "/command/right"} <= set(topics)


def _channels(header: CampaignHeader) -> list[Channel]:
    return [header.channels.drive, header.channels.front, header.channels.rear]


def decoded(path) -> dict[str, list]:
    """Return the messages of an MCAP file by topic, as the library of the format decodes them; checksums are tested."""
    topics: dict[str, list] = {}
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        for schema, channel, message, content in reader.iter_decoded_messages():
            stamp = getattr(content, "header", None)
            if stamp:
                assert stamp.stamp.sec * 10**9 + stamp.stamp.nanosec == message.log_time
            topics.setdefault(channel.topic, []).append((schema.name, message.log_time, content))
        assert reader.get_summary().statistics.message_count == sum(map(len, topics.values()))
    return topics


def test_the_library_of_the_format_reads_poses_commands_plan_and_target(tmp_path):
    line_campaign(tmp_path / "camp")
    run = Campaign.open(tmp_path / "camp").run("trajectory/1")
    export_mcap(tmp_path / "camp", tmp_path / "mcap")
    topics = decoded(tmp_path / "mcap" / "trajectory%2F1" / "trajectory%2F1.mcap")
    assert {name: messages[0][0] for name, messages in topics.items()} == {
        "/pose": "geometry_msgs/msg/PoseStamped",
        "/command/drive": "std_msgs/msg/Float64",
        "/command/front": "std_msgs/msg/Float64",
        "/command/rear": "std_msgs/msg/Float64",
        "/target": "geometry_msgs/msg/PoseStamped",
        "/plan": "nav_msgs/msg/Path",
    }
    poses = [content.pose for _, _, content in topics["/pose"]]
    np.testing.assert_array_equal([pose.position.x for pose in poses], run.frames.x_m)
    heading = [2.0 * np.arctan2(pose.orientation.z, pose.orientation.w) for pose in poses]
    np.testing.assert_allclose(heading, run.frames.heading_rad, atol=1e-12)
    times = np.array([ns for _, ns, _ in topics["/pose"]])
    np.testing.assert_allclose((times - times[0]) * 1e-9, run.frames.t_s - run.frames.t_s[0], atol=1e-9)
    assert [content.data for _, _, content in topics["/command/drive"]] == [1500.0, 1900.0, 1500.0]
    goal = start_pose(run).pose.compose(run.target)
    target = topics["/target"][0][2].pose.position
    end = topics["/plan"][0][2].poses[-1].pose.position
    assert (target.x, target.y) == pytest.approx(goal[:2], abs=1e-9)
    assert (end.x, end.y) == pytest.approx(goal[:2], abs=1e-3)


def test_si_commands_of_a_differential_vehicle_are_twists(tmp_path):
    header = HEADERS["differential"]
    frames = np.column_stack([np.arange(10) / 10, *np.zeros((3, 10))])
    write(tmp_path / "camp", header, a_run(header, frames, np.array([[0.0, 0.5, 0.2, 0.0], [0.5, 0.0, -0.2, 0.0]])))
    export_mcap(tmp_path / "camp", tmp_path / "mcap")
    twists = decoded(tmp_path / "mcap" / "free%2F1" / "free%2F1.mcap")["/cmd_vel"]
    assert [(c.twist.linear.x, c.twist.angular.z) for _, _, c in twists] == [(0.5, 0.2), (0.0, -0.2)]


def test_runs_that_do_not_count_are_not_exported(tmp_path):
    header = HEADERS["two axles"]
    frames = np.column_stack([np.arange(10) / 10, *np.zeros((3, 10))])
    run = a_run(header, frames, np.array([[0.0, 1600.0, 1500.0, 1500.0]]))
    write(tmp_path / "camp", header, run, replace(run, run_id="free/2", status="rejected: 12 frames lost"))
    files = export_mcap(tmp_path / "camp", tmp_path / "mcap").files
    assert [file.name for file in files] == ["free%2F1", MAPPING_FILE]


def test_a_run_without_a_start_has_no_plan_and_the_command_says_so(tmp_path, capsys):
    line_campaign(tmp_path / "camp", rest_frames=0)
    out = tmp_path / "mcap"
    assert main(["export", str(tmp_path / "camp"), "--format", "mcap", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert f"wrote 1 bags and {MAPPING_FILE} to {out}" in printed
    assert "without plan and target, not seen at rest before they began: trajectory/1" in printed
    topics = decoded(out / "trajectory%2F1" / "trajectory%2F1.mcap")
    assert not {"/plan", "/target"} & set(topics)
    assert len(topics["/pose"]) == 700


def test_nothing_is_overwritten_and_nothing_is_left_where_it_cannot_be_written(tmp_path):
    campaign = line_campaign(tmp_path / "camp")
    export_mcap(campaign, tmp_path / "mcap")
    with pytest.raises(FileError, match="trajectory%2F1: exists already; choose another --out"):
        export_mcap(campaign, tmp_path / "mcap")
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(FileError, match="cannot be written"):
        export_mcap(campaign, tmp_path / "file")
    assert not list(tmp_path.rglob(".tmp*"))


def test_without_rosbags_the_command_says_what_to_install(tmp_path):
    line_campaign(tmp_path / "camp")
    program = "import sys; sys.modules['rosbags'] = None; from agvbench.cli import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", program, "export", "camp", "--format", "mcap", "--out", "mcap"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    expected = "agvbench export: --format mcap: needs rosbags, which is not installed; pip install 'agvbench[ros]'"
    assert done.stderr == f"{expected}\n"
    assert not (tmp_path / "mcap").exists()
