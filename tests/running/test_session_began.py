"""Runs say which session they belong to, and plans count the hours since that began."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from agvbench.campaign import Campaign
from agvbench.campaign.campaign import session_starts
from agvbench.running.configuration.settings import BenchSettings, settings_for_resume
from agvbench.running.execution import campaign_time as session_began
from agvbench.running.execution.campaign_time import SessionBegan, idle_notice, last_end_s
from agvbench.running.session import rig_checks
from agvbench.running.session.driver import Driver
from agvbench.running.session.opening import open_session
from agvbench.types import NO_TARGET, Commands, Frames, Run

HOUR_S = 3600.0


def run(started_h, session=None):
    nothing = Commands(*np.zeros((4, 0)))
    return Run(
        "r", "free", "", "uncalibrated", 1, NO_TARGET, started_h * HOUR_S, "ok", "1", nothing, Frames.concatenate([]),
        session=session, extra={"duration_s": 36.0},
    )  # fmt: skip


MONDAY = [run(0.0), run(0.5)]
BOTH = [*MONDAY, run(14.0, "tuesday"), run(14.2, "tuesday")]


@pytest.mark.parametrize(
    ("asked", "recorded", "expected"),
    [
        ("", [], SessionBegan()),
        ("monday", [], SessionBegan("monday")),
        ("", MONDAY, SessionBegan(None, 0.0)),
        ("tuesday", MONDAY, SessionBegan("tuesday")),
        ("tuesday", BOTH, SessionBegan("tuesday", 14.0 * HOUR_S)),
        ("", BOTH, SessionBegan("tuesday", 14.0 * HOUR_S)),
        ("wednesday", BOTH, SessionBegan("wednesday")),
    ],
)
def test_runs_belong_to_what_is_asked_for_or_else_to_what_the_last_belonged_to(asked, recorded, expected):
    assert SessionBegan.of(asked, recorded) == expected


def test_a_session_begins_with_its_first_run_however_long_that_was_prepared():
    before = SessionBegan("tuesday")
    assert before.hours(14.0 * HOUR_S) == 0.0
    begun = before.with_run(14.5 * HOUR_S).with_run(15.0 * HOUR_S)
    assert begun == SessionBegan("tuesday", 14.5 * HOUR_S)
    assert begun.hours(16.0 * HOUR_S) == 1.5


def test_sessions_start_with_their_first_runs():
    assert session_starts(reversed(BOTH)) == {None: 0.0, "tuesday": 14.0 * HOUR_S}


@pytest.mark.parametrize(("asked", "now_h", "told"), [("", 14.0, True), ("", 1.0, False), ("wednesday", 14.0, False)])
def test_a_night_without_a_name_is_pointed_out(asked, now_h, told):
    assert last_end_s(MONDAY) == pytest.approx(0.51 * HOUR_S)
    notices = idle_notice(MONDAY, now_h * HOUR_S, asked)
    assert [notice.split(":")[0] for notice in notices] == ["the last run ended 13.5 h ago"] * told
    assert not idle_notice([], now_h * HOUR_S, asked)


def test_a_name_of_before_goes_on_and_that_is_said():
    (notice,) = idle_notice(BOTH, 38.0 * HOUR_S, "tuesday")
    assert notice.startswith("the last run ended 23.8 h ago, and tuesday goes on: if it was charged")


def test_a_name_is_free_on_resuming_and_not_that_of_the_first_runs():
    began = BenchSettings(session="monday", seed=3)
    assert settings_for_resume(began, {}) == dataclasses.replace(began, session="")
    assert settings_for_resume(began, {"session": "tuesday"}).session == "tuesday"


@pytest.fixture
def charged(monkeypatch):
    """Let simulated vehicles have sessions, and any pause be a long one."""
    monkeypatch.setattr(rig_checks, "check_rig", lambda *_: None)
    monkeypatch.setattr(session_began, "_LONG_AGO_S", -math.inf)


def drive(path, name, *runs):
    options = {"repeats": 1, "session": name} if name else {"repeats": 1}
    hours = []
    with open_session(options, out=str(path), resume=path.exists(), dry_run=False) as session:
        for run_id in runs:
            hours.append(session._bench.departure.started_h)
            Driver(session, run_id, experiment="free", repeat=1).hold(drive=0.5, front=0.5, rear=0.0, for_s=0.3)
    return hours, session.notices


@pytest.mark.usefixtures("charged")
def test_what_is_driven_belongs_to_the_session_and_hours_count_since_its_first_run(tmp_path):
    path = tmp_path / "c"
    assert drive(path, "monday", "a") == ([0.0], [])
    (_, between), notices = drive(path, "", "a", "b")
    assert between > 0.0
    assert "the last run ended" in notices[-1]
    (_, _, new, after), notices = drive(path, "tuesday", "a", "b", "c", "d")
    assert (new, after) == (0.0, pytest.approx(between))
    assert not notices
    assert [run.session for run in Campaign.open(path)] == ["monday", "monday", "tuesday", "tuesday"]
