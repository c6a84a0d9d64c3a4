"""Habits of other benches: where steering stood, when frames and clocks begin, and how levels are rounded."""

import dataclasses

import numpy as np
import pytest
from tiny_vehicle import HEADER, InMemory, Tiny, campaign_runs

from agvbench.campaign import Campaign
from agvbench.diagnosis import diagnose
from agvbench.diagnosis.data.initial_pose import shift_commands_half_a_row, starts_at_rest
from agvbench.diagnosis.data.readings import read_runs
from agvbench.diagnosis.data.splits import with_common_levels
from agvbench.diagnosis.data.windows import horizon_of


def late(run, seconds):
    """Return the run as one who starts the clock so much later tells it: steering had been set long before."""
    c = run.commands
    row = int(np.searchsorted(c.t_s, seconds, side="right")) - 1
    t_s = np.r_[0.0, c.t_s[row + 1 :] - seconds]
    commands = dataclasses.replace(c, t_s=t_s, drive=c.drive[row:], front=c.front[row:], rear=c.rear[row:])
    return dataclasses.replace(
        run, commands=commands, frames=dataclasses.replace(run.frames, t_s=run.frames.t_s - seconds)
    )


@pytest.fixture(scope="module")
def lagging():
    # Steering set 0.4 s before driving has settled by then: told from 0.39 s on, it stood before the clock began.
    return campaign_runs(Tiny(steering_lag_s=0.08))


@pytest.mark.slow
def test_steering_that_stood_before_its_first_command_is_found_out(lagging):
    found = diagnose(InMemory([late(run, 0.39) for run in lagging]))
    assert [effect.name for effect in found.effects] == ["steering_lag"]
    assert found.effects[0].parameters["time_constant_s"].value == pytest.approx(0.08, abs=0.004)
    assert found.provenance["steering_stood_at"] == "the first command"


def test_runs_that_are_seen_from_their_first_command_on_are_runs_from_rest(tiny_campaign):
    runs = tiny_campaign(Tiny()).runs[:30]
    seen = [dataclasses.replace(run, frames=run.frames.select(run.frames.t_s >= 0.0)) for run in runs]
    assert horizon_of(HEADER, seen) is None
    assert all(starts_at_rest(run, HEADER.neutral) for run in seen)
    whole, part = read_runs(runs, HEADER.neutral), read_runs(seen, HEADER.neutral)
    assert np.abs(part.start - whole.start).max() < 1e-3
    # Driven at once, it is the first frame that counts, and it is as uncertain as a frame.
    at_once = read_runs([late(run, 0.4) for run in seen], HEADER.neutral)
    assert len(at_once) == len(seen)


def test_a_start_that_cleaning_leaves_out_is_where_the_vehicle_stood(tiny_campaign):
    run = next(run for run in tiny_campaign(Tiny()).runs if run.experiment == "drive")
    f = run.frames
    seam = dataclasses.replace(f, heading_rad=f.heading_rad + 0.8 * (f.t_s > 0.2))
    (start,) = read_runs([dataclasses.replace(run, frames=seam)], HEADER.neutral).start
    np.testing.assert_allclose(start, read_runs([run], HEADER.neutral).start[0])


def test_clocks_that_begin_elsewhere_are_set_to_the_first_command(tmp_path, tiny_campaign, write_campaign):
    runs = tiny_campaign(Tiny()).runs[:3]
    path = write_campaign(tmp_path / "c", runs)
    moved = tmp_path / "moved"
    moved.mkdir()
    (moved / "campaign.toml").write_bytes((path / "campaign.toml").read_bytes())
    campaign = Campaign.open(path)
    campaign.runs.to_parquet(moved / "runs.parquet")
    for name in ("commands", "poses"):
        table = getattr(campaign, name)
        table.assign(t_s=table.t_s - 0.5).to_parquet(moved / f"{name}.parquet")
    for a, b in zip(Campaign.open(moved).check(), campaign, strict=True):
        np.testing.assert_allclose(a.commands.t_s, b.commands.t_s, atol=1e-12)
        np.testing.assert_allclose(a.frames.t_s, b.frames.t_s, atol=1e-12)


def test_imported_commands_changed_between_two_rows(tiny_campaign):
    run = tiny_campaign(Tiny()).runs[0]
    imported = dataclasses.replace(run, extra={"source_row": 1})
    assert shift_commands_half_a_row(run) is run
    moved = shift_commands_half_a_row(imported).commands.t_s - run.commands.t_s
    np.testing.assert_allclose(moved, [0.0, *([-1.0 / 120.0] * (len(moved) - 1))], atol=1e-9)


def test_levels_that_differ_by_rounding_are_one(tiny_campaign):
    runs = tiny_campaign(Tiny()).runs[:10]
    rounded = [
        dataclasses.replace(
            run, commands=dataclasses.replace(run.commands, front=run.commands.front * (1.0 + k * 1e-13))
        )
        for k, run in enumerate(runs)
    ]
    count = [
        len(np.unique(np.concatenate([run.commands.front for run in told])))
        for told in (runs, with_common_levels(rounded))
    ]
    assert count[0] == count[1]


def stamped_earlier(run, seconds):
    """Return the run with the time stamps of its frames reduced."""
    return dataclasses.replace(run, frames=dataclasses.replace(run.frames, t_s=run.frames.t_s - seconds))


def test_runs_of_a_camera_whose_clock_is_early_begin_at_rest_all_the_same():
    """The pose of 80 ms after the drive's first command has the time stamp of that command."""
    runs = [late(run, 0.4) for run in campaign_runs(Tiny())[:30]]
    assert all(starts_at_rest(stamped_earlier(run, 0.08), HEADER.neutral) for run in runs)
    assert horizon_of(HEADER, [stamped_earlier(run, 0.08) for run in runs]) is None
    fast = [run for run in runs if abs(run.commands.drive[0] - HEADER.neutral.drive) > 300.0]
    assert fast
    assert not any(starts_at_rest(stamped_earlier(run, 2.0), HEADER.neutral) for run in fast)
