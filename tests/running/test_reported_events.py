"""What adapters report while a bench drives: it reaches the operator, the campaign, the run's status and the report."""

from __future__ import annotations

import re
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from agvbench.adapters import AdapterOptions, agv_host, host_adapters, open_rig
from agvbench.bus.keys import Keys
from agvbench.bus.messages.codec import encode
from agvbench.bus.messages.command import CommandFlags, CommandMessage
from agvbench.bus.messages.event import Event, Level
from agvbench.bus.session import open_bus_session as open_bus
from agvbench.campaign import Campaign
from agvbench.errors import AgvbenchError
from agvbench.reporting.sections import all_sections
from agvbench.running.execution import bench, drive
from agvbench.running.quality import Quality, not_as_planned
from agvbench.running.session.opening import open_session
from agvbench.running.supervision.limits import SafetyLimits
from agvbench.types import RUN_OK, Command
from agvbench.workflows.report import gather

VEHICLE = Path(__file__).with_name("watched_vehicle.py")
PERFECT = dict.fromkeys(("lost", "doubled", "late", "wrong", "untracked"), 0.0)


@pytest.fixture
def endpoint() -> Iterator[str]:
    """The vehicle and its camera, for whoever connects."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        where = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    options = AdapterOptions(camera=PERFECT)
    with open_bus(listen=[where]) as bus, host_adapters(bus, "lab", options, agv=str(VEHICLE), mocap="sim"):
        yield where


def in_mid_run(link: Any, do: Callable[[], object]) -> None:
    """Call `do` once while the vehicle drives in the next run."""
    plain, left = link.control_cycle, [do]

    def control_cycle(command: Command, *, t_s: float, hold_s: float) -> Any:
        if left and command.drive != 1500.0 and t_s > 0.7:
            left.pop()()
        return plain(command, t_s=t_s, hold_s=hold_s)

    link.control_cycle = control_cycle


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let only what a test does on purpose spoil a run, however busy the machine is."""
    monkeypatch.setattr(agv_host, "SILENCE_LIMIT_S", 20.0)
    monkeypatch.setattr(bench, "DEFAULT_SAFETY", SafetyLimits(lost_s=20.0, frozen_s=20.0, jump_m=10.0, clock_s=20.0))
    monkeypatch.setattr(Quality, "status", lambda *_: RUN_OK)
    monkeypatch.setattr(drive, "_check_seen", lambda *_, **__: None)


def wait_for(link: Any, kind: str) -> None:
    """Wait until the runner has heard of an event, which it has not looked at yet."""
    deadline_s = time.monotonic() + 10.0
    link = getattr(link, "_link", link)  # that of a bench which others may watch is observed
    while not any(event.kind == kind for event in list(link._inbox.events)):
        assert time.monotonic() < deadline_s, f"{kind} did not come"
        time.sleep(0.01)


@pytest.mark.real_time
@pytest.mark.usefixtures("patient")
def test_events_are_told_kept_counted_and_spoil_the_runs_that_were_not_driven_as_planned(
    endpoint: str, tmp_path: Path
) -> None:
    told: list[str] = []
    stranger = open_bus(connect=[endpoint])
    links: list[Any] = []
    bitten = encode(Event(1, "agv", Level.WARNING, "vehicle_stopped_itself", "the watchdog stopped it"))
    keys = Keys("lab", "agv1")
    wild = encode(CommandMessage(1, 0.0, Command(2000.0, 1500.0, 1500.0), 1.0, CommandFlags.NONE, 666))

    def interfere() -> None:
        stranger.put(keys.report, bitten)
        stranger.put(keys.command, wild)
        wait_for(links[0], "RunStoppedError")

    faults: dict[str, Callable[[], object]] = {
        "quiet": lambda: None,
        "stalled": lambda: time.sleep(2.3),
        "stranger": interfere,
    }
    given = {"connect": endpoint, "vehicle": "", "attempts": 1, "workspace": "circle:12"}
    with (
        open_session(given, out=str(tmp_path / "c"), resume=False, dry_run=False, on_progress=told.append) as session,
        stranger,
    ):
        assert session._bench is not None
        links.append(session._bench.link)
        for name, fault in faults.items():
            in_mid_run(session._bench.link, fault)
            with suppress(AgvbenchError):
                session.driver(name, experiment="free", repeat=1).hold(for_s=0.8, drive=0.5)
        summary = session.events
    campaign = Campaign.open(tmp_path / "c")
    runs = {run.run_id: run for run in campaign}
    assert runs["quiet"].status == "ok"
    assert runs["quiet"].extra["events"] >= 2
    late = r"rejected: [0-9.]+ s between two commands \(limit: 2 s, then the vehicle stops itself\)"
    assert re.match(late, runs["stalled"].status)
    assert runs["stranger"].status.startswith("rejected: ")
    assert "commands of another source: 1, of 0000029a" in runs["stranger"].status
    table = campaign.table("events")
    assert {"battery_low", "commands_late", "RunStoppedError"} <= set(table["event"])
    assert set(table["run_id"][table["event"] == "battery_low"]) == set(faults)
    assert told.count("agv reports battery_low: 7.1 V") == 1
    assert "battery_low: 3 events, see the campaign's table events" in summary
    [section] = [section for section in all_sections() if section.slug == "events"]
    [shown] = [block for block in section.blocks(gather(tmp_path / "c")) if hasattr(block, "rows")]
    assert ["agv", "info", "battery_low", 3, 3, "7.1 V"] in [list(row) for row in shown.rows]


def test_events_in_lock_step_leave_no_times_of_the_wall_clock(tmp_path: Path) -> None:
    event = encode(Event(1, "agv", Level.INFO, "battery_low", "7.1 V", t_s=123.4))
    with open_session({"attempts": 1}, out=str(tmp_path / "c"), resume=False, dry_run=False) as session:
        assert session._bench is not None
        link: Any = session._bench.link
        in_mid_run(link, lambda: link._session.put(link.keys.report, event))
        session.driver("quiet", experiment="free", repeat=1).hold(for_s=0.8, drive=0.5)
    campaign = Campaign.open(tmp_path / "c")
    assert [list(campaign.table("events")[name]) for name in ("event", "adapter_s")] == [["battery_low"], [0.0]]
    assert all("events" not in run.extra for run in campaign)


def test_a_vehicle_that_was_built_for_another_calibration_is_an_event(endpoint: str) -> None:
    with open_rig(connect=endpoint, calibration_hash="ffff0000") as link:
        [event] = link.take_events()
    assert (event.kind, event.level) == ("calibration_differs", Level.WARNING)
    assert event.text == "the vehicle's firmware was built for calibration 0123abcd, the bench drives with ffff0000"
    with open_rig(connect=endpoint, calibration_hash="0123abcd") as link:
        assert link.take_events() == []


def test_the_event_that_says_most_of_why_a_run_does_not_count_is_chosen() -> None:
    def event(kind: str, text: str, level: Level = Level.WARNING) -> Event:
        return Event(1, "agv", level, kind, text)

    short, long = event("commands_late", "0.3 s"), event("commands_late", "0.6 s")
    silent, failed = event("runner_silent", "0.5 s"), event("LinkError", "broken", Level.ERROR)
    assert not_as_planned([event("line_garbled", "x"), event("command_resent", "y")]) is None
    assert not_as_planned([silent, short, failed, long]) is long
    assert not_as_planned([failed, silent]) is silent
    assert not_as_planned([failed]) is failed
