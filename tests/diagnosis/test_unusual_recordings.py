"""Recordings that a lab may well have, and of which a diagnosis says something: without an error or a warning."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from free_drives import FREE_HEADER, free_runs, joystick
from tiny_vehicle import NEUTRAL, InMemory, Tiny, campaign_runs

from agvbench.diagnosis import Verdict, diagnose

CRUISE, LOST = 1150.0, "007"


def cruise(seconds, rng):
    """Return the commands of a driver who speeds up within a second, and keeps the speed while steering."""
    commands = joystick(seconds, rng)
    drive = np.full(len(commands), CRUISE)
    drive[22:36] = np.linspace(NEUTRAL - 60.0, CRUISE + 20.0, 14).round()
    return replace(commands, drive=drive)


def slower(runs, factor):
    """Return runs of a vehicle that drives slower than those by a factor: seen from afar, its path is smaller."""
    return [replace(r, frames=replace(r.frames, x_m=factor * r.frames.x_m, y_m=factor * r.frames.y_m)) for r in runs]


def test_a_cruise_after_a_short_ramp_has_a_map():
    found = diagnose(InMemory(free_runs(Tiny(), sessions=1, runs=2, seconds=90.0, by=cruise), FREE_HEADER))
    assert found.held_out.errors["position_rms_mm"]["after"] < 20.0


def test_driving_without_a_drive_command_is_not_identifiable():
    pushed = [
        replace(r, commands=replace(r.commands, drive=np.full(len(r.commands), NEUTRAL))) for r in free_runs(Tiny())
    ]
    found = diagnose(InMemory(pushed, FREE_HEADER))
    assert (found.verdict, found.why) == (
        Verdict.NOT_IDENTIFIABLE,
        "the drive was never commanded anything but neutral",
    )


@pytest.mark.slow
def test_creeping_has_no_rates_and_is_diagnosed_all_the_same():
    """In an eighth of a window the vehicle moves less than the distance for which there is a rate."""
    found = diagnose(InMemory(slower(free_runs(Tiny(noise_m=1e-5)), 0.15), FREE_HEADER))
    assert found.held_out is not None


def test_a_run_that_is_lost_before_its_first_command_is_refused_alone():
    runs = campaign_runs(Tiny())
    lost = [replace(r, frames=r.frames.select(r.frames.t_s < 0.0)) if r.run_id.startswith(LOST) else r for r in runs]
    found = diagnose(InMemory(lost))
    assert found.provenance["runs_refused"] == {"was not seen after its first command": 1}
    assert found.verdict is Verdict.ADEQUATE
