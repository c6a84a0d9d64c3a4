"""``natnet:emulated``: a simulated camera behind the real protocol sees what it sees without, bit by bit again."""

from __future__ import annotations

import numpy as np
import pytest

from agvbench.adapters import open_rig
from agvbench.types import Command, Frames, Pose

START = Pose(0.5, -0.25, 2.0)
PLANT = "agvbench.simulator:make_plant"


def driven(mocap: str, **camera: float | str) -> list[Frames]:
    """Return the frames of two runs, in the order of their capture."""
    runs = []
    with open_rig("sim", mocap, plant=PLANT, seed=3, camera=camera) as link:
        for run_key in ("a", "b"):
            link.reset(START, run_key=run_key)
            parts = [link.control_cycle(Command(1500.0, 1500.0, 1500.0), t_s=-0.5, hold_s=0.5)]
            parts += [link.control_cycle(Command(1700.0, 1450.0, 1550.0), t_s=0.8 * n, hold_s=0.8) for n in range(4)]
            frames = Frames.concatenate([*parts, link.flush()])
            runs.append(frames.select(np.argsort(frames.t_s, kind="stable")))
    return runs


@pytest.mark.parametrize("version", ["2.9", "3.1", "4.1", "4.2"])
def test_the_protocol_changes_nothing_but_precision(version: str) -> None:
    perfect = dict.fromkeys(("doubled", "late"), 0.0)
    plain, packed = driven("sim", **perfect), driven("natnet:emulated", version=version, **perfect)
    for before, after in zip(plain, packed, strict=True):
        assert len(after) == len(before) > 400
        assert np.array_equal(after.tracked, before.tracked)
        assert np.array_equal(after.frame, before.frame)
        stamp_s = 1e-6 if version >= "3" else 0.1  # before 3.0 a pose carries its arrival
        assert np.allclose(after.t_s, before.t_s, atol=stamp_s)
        for name, tolerance in (("x_m", 1e-6), ("y_m", 1e-6), ("heading_rad", 2e-6), ("mean_error_m", 1e-8)):
            assert np.allclose(getattr(after, name), getattr(before, name), atol=tolerance, equal_nan=True), name


def test_the_same_seed_gives_the_same_bytes() -> None:
    first, second = driven("natnet:emulated"), driven("natnet:emulated")
    for one, other in zip(first, second, strict=True):
        for name in ("t_s", "x_m", "y_m", "heading_rad", "tracked", "frame", "mean_error_m", "received_s"):
            assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True), name


def test_frames_that_come_twice_or_late_arrive_once_and_in_order() -> None:
    (frames, _) = driven("natnet:emulated", doubled=0.2, late=0.1)
    assert (np.diff(frames.frame) > 0).all()
