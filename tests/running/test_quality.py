"""Which runs count: frames made by hand, each fault alone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from agvbench.campaign import Campaign, CampaignHeader, CampaignWriter
from agvbench.errors import SafetyStopError
from agvbench.running.execution.run_records import RunRequest, record_aborted
from agvbench.running.quality import assess
from agvbench.running.rest_detection import is_at_rest, pose_before
from agvbench.types import Commands, Frames, Pose
from agvbench.vehicle.channels import Channels

RATE_HZ = 120.0
BEGIN_S, MOVE_S, END_S = -0.5, 4.0, 6.0
START = Pose(0.5, -1.0, math.radians(179.5))


def frames_of(speed_after_mps=0.0, speed_before_mps=0.0, start=START, noise_m=5e-4, seed=1):
    """A straight drive of 1 m from 0 s to 4 s between two rests, seen with noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(BEGIN_S, END_S, 1 / RATE_HZ)
    driven = np.clip(t, 0.0, MOVE_S) / MOVE_S
    driven += speed_before_mps * np.minimum(t, 0.0) + speed_after_mps * np.maximum(t - MOVE_S, 0.0)
    x = start.x_m + driven * math.cos(start.heading_rad) + rng.normal(0, noise_m, t.size)
    y = start.y_m + driven * math.sin(start.heading_rad) + rng.normal(0, noise_m, t.size)
    heading = np.angle(np.exp(1j * (start.heading_rad + rng.normal(0, 0.003, t.size))))
    nothing = np.full(t.size, np.nan)
    return Frames(t, x, y, heading, np.ones(t.size, bool), np.arange(t.size), nothing, t + 0.01)


def status(frames, start=START):
    return assess(frames, start=start, begin_s=BEGIN_S, end_s=END_S, rate_hz=RATE_HZ).status()


def untracked(frames, chosen):
    x = np.where(chosen, np.nan, frames.x_m)
    return Frames(frames.t_s, x, frames.y_m, frames.heading_rad, ~chosen, frames.frame, x * np.nan, frames.received_s)


@pytest.mark.parametrize("seed", range(5))
def test_a_good_run_counts_although_its_heading_wraps(seed):
    assert status(frames_of(seed=seed)) == "ok"


def test_untracked_and_lost_frames_count_alike():
    good = frames_of()
    third = np.arange(len(good)) % 3 == 0
    assert status(untracked(good, third)).startswith("rejected: tracked share 0.67")
    assert status(good.select(~third)).startswith("rejected: tracked share 0.67")


def test_a_gap_is_told_even_where_the_share_is_good():
    good = frames_of()
    gap = (good.t_s > 1.0) & (good.t_s < 1.35)
    assert status(untracked(good, gap)).startswith("rejected: gap of 0.3")


def test_a_wrong_start_is_told_in_millimetres_and_degrees():
    assert status(frames_of(), start=START._replace(x_m=0.53)).startswith("rejected: start 30.0 mm off")
    turned = START._replace(heading_rad=math.radians(-177.0))
    assert status(frames_of(), start=turned).startswith("rejected: start heading 3.5° off")


def test_moving_at_either_end_is_told():
    assert status(frames_of(speed_before_mps=0.03)) == "rejected: moving before the first command"
    assert status(frames_of(speed_after_mps=0.03)) == "rejected: still moving when the run ended"


def test_single_wild_frames_do_not_make_a_vehicle_move():
    good = frames_of()
    x = good.x_m.copy()
    x[-5] += 3.0
    wild = Frames(good.t_s, x, *(getattr(good, name) for name in ("y_m", "heading_rad", "tracked", "frame")), x, x)
    assert is_at_rest(wild, until_s=END_S)


def test_no_frames_is_no_rest_and_no_run():
    assert not is_at_rest(Frames.empty(), until_s=0.0)
    assert pose_before(Frames.empty(), 0.0) is None
    assert status(Frames.empty()).startswith("rejected: tracked share 0.00")


@pytest.mark.parametrize(("turning_dps", "rests"), [(0.0, True), (0.5, True), (10.0, False), (-10.0, False)])
def test_a_vehicle_that_turns_on_the_spot_is_not_at_rest(turning_dps, rests):
    still = frames_of()
    turned = np.radians(turning_dps) * (still.t_s - END_S)
    heading = np.angle(np.exp(1j * (still.heading_rad + turned)))
    assert is_at_rest(replace(still, heading_rad=heading), until_s=END_S) is rests


@pytest.mark.parametrize("step_s", [3600.0, -3600.0])
def test_a_run_that_a_step_of_the_camera_s_clock_ended_is_kept_until_then(tmp_path, step_s):
    header = CampaignHeader(
        schema=1, name="c", vehicle_name="agv", front_axle_m=0.18, rear_axle_m=0.12,
        channels=Channels.alike("us"), mocap_rate_hz=RATE_HZ,
    )  # fmt: skip
    writer, seen = CampaignWriter.create(tmp_path / "c", header), frames_of()
    late = seen.t_s > 2.0
    stepped = replace(seen, t_s=np.where(late, seen.t_s + step_s, seen.t_s))
    commands = Commands(np.array([0.0, MOVE_S]), np.array([900.0, 1500.0]), *np.full((2, 2), 1500.0))
    request = RunRequest("r", "trajectory", "1", "calibrated", 1, commands, Pose(1.0, 0.0, 0.0), START)
    record_aborted(writer, request, "r", 0.0, [stepped], SafetyStopError("the camera's clock stepped"), "1.0")
    (run,) = Campaign.open(tmp_path / "c")
    assert run.status.startswith("aborted: ")
    assert len(run.frames) == np.count_nonzero(~late)
