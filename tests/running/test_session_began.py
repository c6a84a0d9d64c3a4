"""Runs say which session they belong to, and plans count the hours since that began."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from agvbench.campaign import Campaign
from agvbench.campaign.sessions import session_starts
from agvbench.running import opening
from agvbench.running.driver import Driver
from agvbench.running.opening import open_session
from agvbench.running.session_began import SessionBegan, idle_notice, last_end_s
from agvbench.running.settings import BenchSettings, settings_for_resume
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
        ("monday", [], SessionBegan("monday", 20.0 * HOUR_S)),
        ("", MONDAY, SessionBegan()),
        ("tuesday", MONDAY, SessionBegan("tuesday", 20.0 * HOUR_S)),
        ("tuesday", BOTH, SessionBegan("tuesday", 14.0 * HOUR_S)),
        ("", BOTH, SessionBegan("tuesday", 14.0 * HOUR_S)),
        ("wednesday", BOTH, SessionBegan("wednesday", 20.0 * HOUR_S)),
    ],
)
def test_runs_belong_to_what_is_asked_for_or_else_to_what_the_last_belonged_to(asked, recorded, expected):
    assert SessionBegan.of(asked, recorded, 20.0 * HOUR_S) == expected


def test_sessions_start_with_their_first_runs():
    assert session_starts(reversed(BOTH)) == {None: 0.0, "tuesday": 14.0 * HOUR_S}


@pytest.mark.parametrize(("asked", "now_h", "told"), [("", 14.0, True), ("", 1.0, False), ("tuesday", 14.0, False)])
def test_a_night_without_a_name_is_pointed_out(asked, now_h, told):
    assert last_end_s(MONDAY) == pytest.approx(0.51 * HOUR_S)
    notices = idle_notice(MONDAY, now_h * HOUR_S, asked)
    assert [notice.split(":")[0] for notice in notices] == ["the last run ended 13.5 h ago"] * told
    assert not idle_notice([], now_h * HOUR_S, asked)


def test_a_name_is_free_on_resuming_and_not_that_of_the_first_runs():
    began = BenchSettings(session="monday", seed=3)
    assert settings_for_resume(began, {}) == dataclasses.replace(began, session="")
    assert settings_for_resume(began, {"session": "tuesday"}).session == "tuesday"


def test_what_is_driven_belongs_to_the_session_and_hours_count_since_it_began(tmp_path, monkeypatch):
    made, real = [], opening.Bench
    monkeypatch.setattr(opening, "SessionBegan", Tuesday)
    monkeypatch.setattr(opening, "Bench", lambda *given, **named: made.append(real(*given, **named)) or made[-1])
    with open_session({"repeats": 1}, out=str(tmp_path / "c"), resume=False, dry_run=False) as session:
        assert made[0].departure.started_h == pytest.approx(2.0)
        Driver(session, "left", experiment="free", repeat=1).hold(drive=0.5, front=0.5, rear=0.0, for_s=0.3)
    assert [run.session for run in Campaign.open(tmp_path / "c")] == ["tuesday"]


class Tuesday:
    """A session that began two hours before the campaign's clock."""

    @staticmethod
    def of(*_):
        return SessionBegan("tuesday", -2.0 * HOUR_S)
