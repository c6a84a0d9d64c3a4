"""Clock offsets of sessions: found where one session has another clock, and nowhere else."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from differential_vehicle import COARSE, Campaign, Differential
from free_drives import FREE_HEADER, free_runs
from tiny_vehicle import InMemory, Tiny

from agvbench.diagnosis import diagnose
from agvbench.diagnosis.data.session_clocks import aligned, clock_offsets
from agvbench.types import Run
from agvbench.workflows.diagnosis_files import sessions_in_words


def late(runs: list[Run], session: str, seconds: float) -> list[Run]:
    """Return runs in which the camera's clock is behind in one session: poses are stamped late."""
    return [
        dataclasses.replace(run, frames=dataclasses.replace(run.frames, t_s=run.frames.t_s + seconds))
        if run.session == session
        else run
        for run in runs
    ]


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    "hidden", [{}, {"yaw_lag_s": 0.4}, {"yaw_lag_s": 1.6}, {"delay_s": 0.2}, {"slip_by_speed": 1.0}]
)
def test_what_all_sessions_share_is_no_offset(hidden, seed):
    offsets = clock_offsets(Campaign(Differential(**hidden), seed=seed, sessions=3).runs, is_differential=True)
    assert len(offsets) == 3
    assert not any(offset.significant for offset in offsets.values())
    assert max(abs(offset.value_s) for offset in offsets.values()) < 0.02


@pytest.mark.parametrize("offset_s", [-0.15, 0.06, 0.3])
@pytest.mark.parametrize("partial", [(), ("day 2",)])
def test_one_session_with_another_clock_is_found_from_its_first_seconds_too(offset_s, partial):
    runs = late(Campaign(Differential(yaw_lag_s=0.2), sessions=3).runs, "day 2", offset_s)
    offsets = clock_offsets(runs, is_differential=True, partial=partial)
    assert [name for name, offset in offsets.items() if offset.significant] == ["day 2"]
    found = offsets["day 2"]
    assert found.value_s == pytest.approx(offset_s, abs=max(3.0 * found.stderr_s, 0.015))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("offset_s", [0.0, 0.12])
@pytest.mark.parametrize("partial", [(), ("day 2",)])
def test_ten_noisy_poses_a_second_tell_it_too(partial, offset_s, seed):
    runs = late(Campaign(COARSE, seed=seed, sessions=3).runs, "day 2", offset_s)
    offsets = clock_offsets(runs, is_differential=True, partial=partial)
    assert [name for name, offset in offsets.items() if offset.significant] == (["day 2"] if offset_s else [])
    assert offsets["day 2"].value_s == pytest.approx(offset_s, abs=0.03)


@pytest.mark.slow
def test_steered_axles_tell_it_by_their_curvature():
    runs = late(free_runs(Tiny(steering_lag_s=0.15), sessions=3, runs=2), "day 1", 0.12)
    offsets = clock_offsets(runs, is_differential=False)
    assert [name for name, offset in offsets.items() if offset.significant] == ["day 1"]
    assert offsets["day 1"].value_s == pytest.approx(0.12, abs=0.02)


def test_commands_are_moved_to_the_clock_of_the_others():
    runs = late(Campaign(Differential(), sessions=3).runs, "day 0", 0.2)
    moved = aligned(runs, clock_offsets(runs, is_differential=True))
    for before, after in zip(runs, moved, strict=True):
        shift = float(np.unique(np.round(after.commands.t_s - before.commands.t_s, 9))[0])
        assert shift == pytest.approx(0.2 if before.session == "day 0" else 0.0, abs=0.02)
    assert not any(offset.significant for offset in clock_offsets(moved, is_differential=True).values())


def test_a_single_session_has_no_offset():
    assert clock_offsets(Campaign(Differential(), sessions=1).runs, is_differential=True) == {}


@pytest.mark.slow
def test_a_diagnosis_names_the_session_and_predicts_it_as_well_as_the_others():
    runs = late(free_runs(Tiny(steering_lag_s=0.25), runs=2, seconds=24.0), "day 3", 0.15)
    split = [dataclasses.replace(run, split="held_out" if run.session == "day 3" else "fit") for run in runs]
    found = diagnose(InMemory(split, FREE_HEADER))
    assert [effect.name for effect in found.effects] == ["steering_lag"]
    assert found.effects[0].parameters["time_constant_s"].value == pytest.approx(0.25, abs=0.03)
    clock = found.provenance["windows"]["sessions"]["day 3"]["clock_offset"]
    assert clock["significant"]
    assert clock["value_s"] == pytest.approx(0.15, abs=0.02)
    words = list(sessions_in_words(found.to_json()))
    assert len(words) == 1
    assert words[0].startswith("Session day 3: camera clock 0.1")
    assert found.held_out.errors["position_rms_mm"]["after"] < 0.3 * found.held_out.errors["position_rms_mm"]["before"]
