"""Whether numbers are plausible is asked of runs of any length."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from differential_vehicle import Campaign, Differential
from hypothesis import example, given
from hypothesis import strategies as st
from tiny_vehicle import HEADER, NEUTRAL, Tiny, drive, held

from agvbench.diagnosis.checks.consistency import _tracks, require_plausible_units
from agvbench.errors import CampaignError
from agvbench.types import NO_TARGET, Frames, Pose, Run

RATE_HZ = 120.0
COMMANDS = held(900.0, NEUTRAL, NEUTRAL, 4.0)
FRAMES = drive(Tiny(), COMMANDS, Pose(0.0, 0.0, 0.0), 0.0, np.random.default_rng(0))
RUN = Run("a", "drive", "", "calibrated", 1, NO_TARGET, 0.0, "ok", "tiny", COMMANDS, FRAMES)


# Of three in a thousand lengths, the last of the moments looked at is rounded past the last frame.
@given(st.integers(-200, 0), st.integers(0, 2400))
@example(-142, 1476)
def test_a_run_of_any_length(first, count):
    t_s = first / RATE_HZ + np.arange(count + 1) / RATE_HZ
    still, nan = np.zeros(count + 1), np.full(count + 1, np.nan)
    tracked, number = np.ones(count + 1, dtype=np.bool_), np.full(count + 1, -1)
    frames = Frames(t_s, 0.3 * t_s, still, still, tracked, number, nan, nan)
    run = replace(RUN, frames=frames)
    require_plausible_units([run], HEADER)
    last_s = -np.inf
    for k, (when, poses, _) in enumerate(_tracks([run])):
        assert when[0] == t_s[0] if k == 0 else when[0] > last_s
        last_s = when[-1]
        assert last_s <= t_s[-1]
        assert np.all(np.diff(when) > 0.0)
        np.testing.assert_array_equal(poses[:, 0], 0.3 * when)


def test_every_frame_doubled_is_no_other_unit():
    frames = RUN.frames.select(np.repeat(np.arange(len(RUN.frames)), 3))
    require_plausible_units([replace(RUN, frames=frames)], HEADER)
    in_milliseconds = replace(frames, t_s=1000.0 * frames.t_s)
    with pytest.raises(CampaignError, match="t_s is not in seconds"):
        require_plausible_units([replace(RUN, frames=in_milliseconds)], HEADER)


@pytest.mark.parametrize("seed", range(3))
def test_noise_of_a_vehicle_that_turns_on_the_spot_is_no_path(seed):
    campaign = Campaign(Differential(noise_m=0.015), seed=seed)
    require_plausible_units(campaign.runs, campaign.header)


def test_a_mirrored_floor_of_such_a_vehicle_is_refused():
    campaign = Campaign(Differential(noise_m=0.002))
    mirrored = [replace(run, frames=replace(run.frames, y_m=-run.frames.y_m)) for run in campaign]
    with pytest.raises(CampaignError, match="heading_rad and the floor are mirrored"):
        require_plausible_units(mirrored, campaign.header)


def squares(corner_rad, *, marker_m):
    """Return runs of a vehicle that turns by `corner_rad` on the spot after each metre, which bends."""
    rate, tracked_m, legs = 20.0, marker_m, 12
    x = y = heading = 0.0
    poses = []
    for _ in range(legs):
        for turn, metres, seconds in ((0.8, 1.0, 3.0), (corner_rad, 0.0, 1.5)):
            steps = round(seconds * rate)
            for _step in range(steps):
                heading += turn / steps
                x, y = x + np.cos(heading) * metres / steps, y + np.sin(heading) * metres / steps
                poses.append((x + tracked_m * np.cos(heading), y + tracked_m * np.sin(heading), heading))
    x, y, heading = np.array(poses).T
    t_s, many = np.arange(len(x)) / rate, len(x)
    nan, number = np.full(many, np.nan), np.full(many, -1)
    frames = Frames(t_s, x, y, heading, np.ones(many, dtype=np.bool_), number, nan, nan)
    return [replace(RUN, run_id=f"square {k}", frames=frames) for k in range(6)]


# A right angle modulo half a turn is to the left as much as to the right.
@pytest.mark.parametrize("marker_m", [0.0, -0.04, 0.1])
@pytest.mark.parametrize("corner_rad", [np.pi / 2, -np.pi / 2, 1.7, 1.45])
def test_corners_of_squares_are_no_mirrored_floor(corner_rad, marker_m):
    runs, header = squares(corner_rad, marker_m=marker_m), replace(HEADER, mocap_rate_hz=20.0)
    require_plausible_units(runs, header)
    mirrored = [replace(run, frames=replace(run.frames, y_m=-run.frames.y_m)) for run in runs]
    with pytest.raises(CampaignError, match="heading_rad"):
        require_plausible_units(mirrored, header)
