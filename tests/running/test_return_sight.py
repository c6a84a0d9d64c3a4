"""What a returning vehicle is believed to do, from frames that are late, few or wrong."""

from __future__ import annotations

import numpy as np
import pytest

from agvbench.running.positioning.automatic_return.motion_interface import PoseEstimator
from agvbench.types import Frames


def seen(t_s: np.ndarray) -> Frames:
    """Return frames of a vehicle that drives at 0.2 m/s along x, turning at 0.1 rad/s near half a turn."""
    n = len(t_s)
    heading = np.angle(np.exp(1j * (np.pi - 0.05 + 0.1 * t_s)))
    return Frames(t_s, -0.2 * t_s, 0.0 * t_s, heading, np.ones(n, bool), np.arange(n), np.zeros(n), t_s + 0.2)


@pytest.mark.parametrize(("rate_hz", "late_s"), [(120.0, 0.006), (120.0, 0.25), (25.0, 0.05), (360.0, 0.0)])
def test_the_pose_is_carried_on_to_the_present(rate_hz: float, late_s: float) -> None:
    pose_estimator, t_s = PoseEstimator(), np.arange(0.0, 3.0, 1.0 / rate_hz)
    for now_s in np.arange(0.1, 2.9, 0.1).tolist():
        arrived = (t_s + late_s < now_s) & (t_s + late_s >= now_s - 0.1)
        pose_estimator.update(seen(t_s[arrived]), now_s)
    assert pose_estimator.pose is not None
    assert pose_estimator.pose.x_m == pytest.approx(-0.2 * 2.8, abs=2e-3)
    assert np.cos(pose_estimator.pose.heading_rad - (np.pi - 0.05 + 0.28)) == pytest.approx(1.0, abs=1e-4)
    assert pose_estimator.speed_mps == pytest.approx(0.2, rel=0.05)


def test_single_wrong_frames_and_silence_change_little() -> None:
    pose_estimator, t_s = PoseEstimator(), np.arange(240) / 120.0
    frames = seen(t_s)
    frames.x_m[[100, 150, 190]] += 2.0
    for i in range(0, 240, 12):
        if i == 180:
            pose_estimator.update(Frames.empty(), t_s[i] + 0.1)
        else:
            pose_estimator.update(frames.select(np.arange(i, i + 12)), float(t_s[i]) + 0.1)
        assert i < 36 or pose_estimator.pose.x_m == pytest.approx(-0.2 * (t_s[i] + 0.1), abs=3e-3)  # type: ignore[union-attr]
