"""A campaign of one trajectory through everything: bus, serial protocol, firmware, pulses, plant, NatNet, recorder."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from agvbench.campaign import Campaign
from agvbench.model import thesis_vehicle

PROGRAM = "import sys; from agvbench.cli import main; sys.exit(main())"

pytestmark = pytest.mark.usefixtures("firmware")


def bench(directory: Path, vehicle: Path, *more: str) -> subprocess.CompletedProcess[str]:
    arguments = ["bench", "trajectories", "-k", "5-cal", "--repeats=2", "--no-report", "--mocap=natnet:emulated"]
    arguments += [f"--calibration={vehicle}", f"--out={directory}", *more]
    return subprocess.run(
        [sys.executable, "-c", PROGRAM, *arguments], capture_output=True, text=True, check=False, timeout=300
    )


@pytest.mark.slow
def test_a_campaign_with_firmware_is_recorded_and_the_same_again(tmp_path: Path) -> None:
    vehicle = tmp_path / "vehicle.toml"
    thesis_vehicle().save(vehicle)
    campaigns = []
    for name in ("first", "again"):
        done = bench(tmp_path / name, vehicle, "--agv=simavr")
        assert done.returncode == 0, done.stderr
        campaigns.append(Campaign.open(tmp_path / name))
    first, again = campaigns
    assert set(first.runs["firmware"]) == {"agvbench 2 in simavr"}
    assert set(first.runs["status"]) == {"ok"}
    assert len(first.run_ids) == 2
    for one, other in zip(first, again, strict=True):
        assert np.array_equal(one.frames.x_m, other.frames.x_m, equal_nan=True)
        assert np.array_equal(one.frames.t_s, other.frames.t_s)
    moved = [
        np.nanmax(np.hypot(run.frames.x_m - run.frames.x_m[0], run.frames.y_m - run.frames.y_m[0])) for run in first
    ]
    assert min(moved) > 0.5
    # Runs differ in where in the servo frame their commands fell, and in all that the plant does by chance.
    assert moved[0] != moved[1]


def test_a_firmware_that_does_not_exist_is_one_line_and_exit_code_2(tmp_path: Path) -> None:
    vehicle = tmp_path / "vehicle.toml"
    thesis_vehicle().save(vehicle)
    done = bench(tmp_path / "none", vehicle, "--agv=simavr:9")
    assert done.returncode == 2
    assert "no such firmware: '9' (one of: 1, 2)" in done.stderr
    assert "Traceback" not in done.stderr + done.stdout
