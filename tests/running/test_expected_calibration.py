"""Before anything is measured a dry run plans what the calibrated vehicle will drive, in a folder of one's own, too."""

from __future__ import annotations

import dataclasses

import pytest

from agvbench.model import thesis_vehicle
from agvbench.running.opening import open_session
from agvbench.running.vehicles import expected_calibration, uncalibrated_vehicle
from agvbench.workflows.init import make_lab


def test_a_new_lab_can_plan_every_trajectory(tmp_path):
    make_lab(tmp_path / "lab")
    options = {"vehicle": str(tmp_path / "lab" / "vehicle.toml")}
    with open_session(options, out=str(tmp_path / "c"), resume=False, dry_run=True) as session:
        for name in map(str, range(1, 9)):
            assert session.plan(session.trajectory(name), "calibrated").duration_s > 0.0


def test_half_speed_is_expected_halfway_and_the_rest_is_believed(tmp_path):
    uncalibrated_vehicle().save(tmp_path / "vehicle.toml")
    expected = expected_calibration(str(tmp_path / "vehicle.toml"))
    believed = uncalibrated_vehicle(str(tmp_path / "vehicle.toml"))
    full = believed.drive.output_low
    assert expected.drive.inverse(full / 2.0) == pytest.approx(
        (believed.drive.command_low + believed.drive.command_stop) / 2.0
    )
    assert dataclasses.replace(expected, drive=believed.drive) == believed


def test_a_drive_that_is_known_stays(tmp_path):
    thesis_vehicle().save(tmp_path / "vehicle.toml")
    assert expected_calibration(str(tmp_path / "vehicle.toml")) == uncalibrated_vehicle(str(tmp_path / "vehicle.toml"))
