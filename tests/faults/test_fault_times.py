"""From when on a fault of a camera counts: docs/reference/faults.md states it for each way of placing."""

from __future__ import annotations

import numpy as np

from agvbench.adapters import open_rig
from agvbench.running.links import ContinuousLink
from agvbench.types import Command, Frames, Pose

NEUTRAL, DRIVE = Command(1500.0, 1500.0, 1500.0), Command(1800.0, 1500.0, 1500.0)
START = Pose(0.0, 0.0, 0.0)
CAMERA = {"lost": 0.0, "late": 0.0, "doubled": 0.0, "untracked": 0.0, "wrong": 0.0}


def run(link: ContinuousLink, key: str | None) -> Frames:
    """Rest for 0.5 s and drive for 1 s; place the vehicle before if there is a key."""
    if key is not None:
        link.reset(START, run_key=key)
    resting = link.control_cycle(NEUTRAL, t_s=-0.5, hold_s=0.5)
    return Frames.concatenate([resting, link.control_cycle(DRIVE, t_s=0.0, hold_s=1.0)])


def frozen_from(frames: Frames) -> float:
    """Return the time [s] of the first frame that repeats the pose before it, infinity if none does."""
    repeated = np.flatnonzero(np.diff(frames.x_m) == 0.0)
    return float(frames.t_s[repeated[0]]) if len(repeated) else np.inf


def test_a_run_that_begins_with_a_placement_has_its_own_time() -> None:
    with open_rig(mocap="impaired:frozen@2/0.5:sim", camera=CAMERA) as rig:
        first, second = (rig_run(rig, key) for key in ("a", "b"))
    assert frozen_from(first) == np.inf
    assert abs(frozen_from(second) - 0.5) < 0.02


def rig_run(rig, key: str) -> Frames:
    rig.reset(START, run_key=key)
    resting = rig.control_cycle(NEUTRAL, t_s=-0.5, hold_s=0.5)
    return Frames.concatenate([resting, rig.control_cycle(DRIVE, t_s=0.0, hold_s=1.0)])


def test_runs_without_a_placement_are_all_the_first_whose_time_goes_on() -> None:
    with open_rig(mocap="impaired:frozen@1/2:sim", camera=CAMERA) as rig:
        link = ContinuousLink(rig)
        first, second = run(link, "a"), run(link, None)
    assert frozen_from(first) == np.inf
    assert abs(frozen_from(second) - 0.0) < 0.02  # 2 s after the placement: 1.5 s of the first run, 0.5 s at rest
