"""Real time: a simulated vehicle that nobody waits for, on the wall clock. Nothing here asserts how fast it is."""

from __future__ import annotations

import re
import threading
import time

import numpy as np
import pytest
import zenoh
from rig_driving import NEUTRAL, START, TINY

from agvbench.adapters import AdapterOptions, open_rig
from agvbench.adapters.agv_host import AgvHost
from agvbench.adapters.contract import AgvAdapter
from agvbench.bus import real_time
from agvbench.bus.clock import SimulatedClock, WallClock
from agvbench.bus.keys import AGV, CLAIM, Keys
from agvbench.bus.messages.codec import encode
from agvbench.bus.messages.command import CommandFlags, CommandMessage
from agvbench.bus.messages.event import Event, decode_event
from agvbench.bus.messages.identity import AgvIdentity
from agvbench.bus.messages.request import ClaimMessage, TimeMessage
from agvbench.bus.queries import ask
from agvbench.bus.real_time import Failure, measure_offset
from agvbench.bus.session import open_bus_session
from agvbench.errors import AgvbenchError, LinkError, RunStoppedError
from agvbench.types import Command, Frames
from agvbench.vehicle.channels import Channels

pytestmark = pytest.mark.real_time

MOVING = NEUTRAL._replace(drive=1800.0)


def test_frames_carry_the_runs_clock_and_show_the_drive() -> None:
    perfect = dict.fromkeys(("lost", "doubled", "late", "wrong", "untracked", "marker_noise_m"), 0.0)
    with open_rig("live", plant=TINY, camera=perfect) as link:
        assert link.identity().simulated
        assert not link.identity().lock_step
        link.reset(START, run_key="a")
        parts = [link.control_cycle(NEUTRAL, t_s=-0.3, hold_s=0.3)]
        parts.append(link.control_cycle(Command(1900.0, 1500.0, 1500.0), t_s=0.0, hold_s=0.4))
        parts.append(link.control_cycle(NEUTRAL, t_s=0.4, hold_s=0.2))
        parts.append(link.flush())
        assert link.loss.lost == 0
    frames = Frames.concatenate(parts)
    along_m = np.hypot(frames.x_m - START.x_m, frames.y_m - START.y_m)
    rest = frames.t_s < 0.0
    assert rest.any()
    assert np.allclose(along_m[rest], 0.0, atol=1e-9)
    assert along_m[-1] > 0.05
    assert np.all(np.diff(along_m) >= -1e-9)
    assert np.all(frames.received_s >= frames.t_s)
    # The plant drives at most 0.41 m/s: however late a command is, no frame is ahead of its own time stamp.
    assert np.all(along_m <= 0.42 * np.maximum(0.0, frames.t_s + 0.05))


def test_a_second_run_begins_at_its_own_zero() -> None:
    with open_rig("live", plant=TINY) as link:
        for run_key in ("a", "b"):
            link.reset(START, run_key=run_key)
            frames = link.control_cycle(NEUTRAL, t_s=-0.2, hold_s=0.2)
            assert np.all(frames.t_s < 0.1)


@pytest.mark.parametrize("order", [(LinkError, RunStoppedError), (RunStoppedError, LinkError)])
def test_what_ends_a_run_does_not_replace_what_ends_the_session(order: tuple[type[AgvbenchError], ...]) -> None:
    with open_rig("live", plant=TINY) as link:
        for error in order:
            link._session.put(link.keys.report, encode(Event.of_error(error(f"made up {error.__name__}"), AGV)))
        while len(link._inbox.events) < len(order):
            time.sleep(0.01)
        with pytest.raises(LinkError, match="made up LinkError"):
            link.control_cycle(NEUTRAL, t_s=0.0, hold_s=0.05)


def test_what_ends_the_session_is_not_forgotten_with_what_ended_a_run_at_the_same_instant(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    failure = Failure()
    failure.note(RunStoppedError("made up"))
    other = threading.Thread(target=failure.note, args=(LinkError("made up LinkError"),))
    starts = [other]

    def looks(error: object, kind: type) -> bool:
        if starts:
            starts.pop().start()
            other.join(0.2)  # for ever, if it has to wait for this thread
        return isinstance(error, kind)

    monkeypatch.setattr(real_time, "isinstance", looks, raising=False)
    with pytest.raises(RunStoppedError):
        failure.check()
    other.join()
    with pytest.raises(LinkError, match="made up LinkError"):
        failure.check()


class Silent(AgvAdapter):
    """Notes when it is stopped."""

    scheme = "silent"

    def __init__(self) -> None:
        self.applied: list[CommandMessage] = []
        self.stopped = threading.Event()
        self.fourth_came = threading.Event()

    @classmethod
    def open(cls, address: str, options: AdapterOptions) -> Silent:
        return cls()

    def identity(self) -> AgvIdentity:
        return AgvIdentity("agv1", "silent", "1", "", Channels.alike("us"), simulated=False, lock_step=False)

    def apply(self, message: CommandMessage) -> None:
        self.applied.append(message)
        if message.sequence == 4:
            self.fourth_came.set()

    def stop(self) -> None:
        self.stopped.set()

    def close(self) -> None:
        pass


def claimed_host(session: zenoh.Session, keys: Keys, adapter: AgvAdapter, source: int = 0) -> AgvHost:
    """Put a vehicle on the bus, and claim it for the runner `source`."""
    host = AgvHost(session, keys, adapter, WallClock(), show=lambda _: None)
    ask(session, keys.queryable(AGV, CLAIM), encode(ClaimMessage(source)), 5.0)
    return host


def test_a_vehicle_whose_runner_falls_silent_is_stopped() -> None:
    adapter, keys = Silent(), Keys("lab", "agv1")
    with open_bus_session() as session:
        events = session.declare_subscriber(keys.report)
        host = claimed_host(session, keys, adapter)
        session.put(keys.command, encode(CommandMessage(1, 0.0, MOVING, 10.0)))
        assert adapter.stopped.wait(10.0)
        assert b"runner_silent" in events.recv().payload.to_bytes()
        assert len(adapter.applied) == 1
        adapter.stopped.clear()
        host.close()
        assert adapter.stopped.is_set()


def test_a_vehicle_at_rest_is_stopped_without_an_event_when_no_command_comes() -> None:
    adapter, keys, told = Silent(), Keys("lab", "agv1"), []
    with open_bus_session() as session:
        events = session.declare_subscriber(keys.report, lambda sample: told.append(sample.payload.to_bytes()))
        host = claimed_host(session, keys, adapter)
        session.put(keys.command, encode(CommandMessage(1, 0.0, NEUTRAL, 10.0)))
        assert adapter.stopped.wait(10.0)
        host.close()
        events.undeclare()
    assert told == []


def test_a_vehicle_that_no_runner_has_takes_stops_only_and_is_stopped_when_its_runner_vanishes() -> None:
    adapter, keys = Silent(), Keys("lab", "agv1")
    with open_bus_session() as session:
        events = session.declare_subscriber(keys.report)
        token = session.liveliness().declare_token(keys.runner(7))
        host = claimed_host(session, keys, adapter, 7)
        session.put(keys.command, encode(CommandMessage(1, 0.0, MOVING, 10.0, CommandFlags.NONE, 7)))
        while not adapter.applied:
            time.sleep(0.01)
        token.undeclare()
        assert b"its runner is gone: vehicle stopped" in events.recv().payload.to_bytes()
        assert adapter.stopped.is_set()
        adapter.stopped.clear()
        session.put(keys.command, encode(CommandMessage(1, 0.0, MOVING, 10.0, CommandFlags.NONE, 666)))
        assert b"foreign_commands" in events.recv().payload.to_bytes()
        session.put(keys.command, encode(CommandMessage(2, 0.0, NEUTRAL, 0.0, CommandFlags.STOP, 666)))
        assert adapter.stopped.wait(10.0)
        host.close()
    assert len(adapter.applied) == 1


class Jammed(Silent):
    """Cannot be stopped the first time."""

    def stop(self) -> None:
        if not self.stopped.is_set():
            self.stopped.set()
            raise RuntimeError("jammed")
        self.fourth_came.set()


def test_a_stop_that_fails_is_told_and_tried_again() -> None:
    adapter, keys = Jammed(), Keys("lab", "agv1")
    with open_bus_session() as session:
        events = session.declare_subscriber(keys.report)
        host = claimed_host(session, keys, adapter)
        session.put(keys.command, encode(CommandMessage(1, 0.0, NEUTRAL, 10.0)))
        assert b"jammed" in events.recv().payload.to_bytes()
        assert adapter.fourth_came.wait(10.0)
        host.close()


class Hanging(Silent):
    """Does not come back from its first command until it is let go, and drives then."""

    def __init__(self) -> None:
        super().__init__()
        self.let_go, self.stops_after = threading.Event(), threading.Event()

    def apply(self, message: CommandMessage) -> None:
        self.let_go.wait(10.0)
        super().apply(message)

    def stop(self) -> None:
        (self.stops_after if self.applied else self.stopped).set()


def test_what_hangs_and_comes_back_driving_is_stopped_again() -> None:
    adapter, keys = Hanging(), Keys("lab", "agv1")
    with open_bus_session() as session:
        host = claimed_host(session, keys, adapter)
        session.put(keys.command, encode(CommandMessage(1, 0.0, NEUTRAL, 10.0)))
        assert adapter.stopped.wait(10.0)
        adapter.let_go.set()
        assert adapter.stops_after.wait(10.0)
        host.close()


class Stuttering(Silent):
    """Takes longer over a command than its vehicle waits for the next."""

    def apply(self, message: CommandMessage) -> None:
        time.sleep(0.3)
        super().apply(message)


def test_a_gap_is_told_to_each_runner_even_if_the_one_before_had_a_longer_one() -> None:
    adapter, keys, told = Silent(), Keys("lab", "agv1"), []
    with open_bus_session() as session:
        events = session.declare_subscriber(keys.report, lambda sample: told.append(sample.payload.to_bytes()))
        host = claimed_host(session, keys, adapter)
        for number, pause_s in enumerate((0.45, 0.1, 0.3, 0.1), start=1):
            if number == 3:
                ask(session, keys.queryable(AGV, CLAIM), encode(ClaimMessage(0)), 5.0)
            session.put(keys.command, encode(CommandMessage(number, 0.0, MOVING, 1.0)))
            time.sleep(pause_s)
        host.close()
        events.undeclare()
    assert sum(b"commands_late" in one for one in told) == 2


@pytest.mark.parametrize("channel", ["drive", "front", "rear"])
def test_commands_further_apart_than_the_watchdog_allows_are_told_with_both_figures_while_any_is_held(
    channel: str,
) -> None:
    adapter, keys, told = Stuttering(), Keys("lab", "agv1"), []
    with open_bus_session() as session:
        events = session.declare_subscriber(keys.report, lambda sample: told.append(sample.payload.to_bytes()))
        host = claimed_host(session, keys, adapter)
        for number, value in enumerate((1500.0, 1500.0, 1800.0, 1500.0), start=1):
            command = NEUTRAL._replace(**{channel: value})
            session.put(keys.command, encode(CommandMessage(number, 0.0, command, 1.0)))
            while len(adapter.applied) < number:
                time.sleep(0.01)
        host.close()
        events.undeclare()
    late = [decode_event(one).text for one in told if b"commands_late" in one]
    assert len(late) == 1
    assert re.fullmatch(r"0\.\d\d s between two commands \(limit: 0.25 s, then the vehicle stops itself\)", late[0])


def test_a_flush_which_the_vehicle_does_not_hear_ends_no_gap() -> None:
    adapter, keys, told = Silent(), Keys("lab", "agv1"), []
    with open_bus_session() as session:
        events = session.declare_subscriber(keys.report, lambda sample: told.append(sample.payload.to_bytes()))
        host = claimed_host(session, keys, adapter)
        for number, flags in enumerate((CommandFlags.NONE, CommandFlags.FLUSH, CommandFlags.NONE), start=1):
            session.put(keys.command, encode(CommandMessage(number, 0.0, MOVING, 1.0, flags)))
            time.sleep(0.2)
        host.close()
        events.undeclare()
    assert sum(b"commands_late" in one for one in told) == 1


def test_lost_commands_and_nonsense_are_told_and_do_not_stop_the_host() -> None:
    adapter, keys = Silent(), Keys("lab", "agv1")
    with open_bus_session() as session:
        events = session.declare_subscriber(keys.report)
        host = claimed_host(session, keys, adapter)
        session.put(keys.command, b"nonsense")
        assert b"command message cannot be decoded" in events.recv().payload.to_bytes()
        for number in (1, 4):
            session.put(keys.command, encode(CommandMessage(number, 0.0, NEUTRAL, 10.0)))
        assert b"2 commands were lost before 4" in events.recv().payload.to_bytes()
        assert adapter.fourth_came.wait(10.0)
        host.close()
        assert host.loss.lost == 2
        # The first may have been overtaken while it waited.
        assert [message.sequence for message in adapter.applied] in ([1, 4], [4])


def test_the_offset_of_another_clock_is_found() -> None:
    here, ahead_s = SimulatedClock(50.0), 1234.5
    with open_bus_session() as session:
        clock = session.declare_queryable("agvbench/v2/lab/agv1/mocap/time")

        def answer() -> None:
            for _ in range(8):
                with clock.handler.recv() as query:
                    here.sleep(0.010)  # half of the way there takes time, the way back takes none
                    query.reply(query.key_expr, encode(TimeMessage(here.now() + ahead_s)))

        thread = threading.Thread(target=answer)
        thread.start()
        offset_s = measure_offset(session, "agvbench/v2/lab/agv1/mocap/time", here)
        thread.join()
    assert abs(offset_s + ahead_s) <= 0.005 + 1e-9


def test_a_real_runner_that_thinks_between_runs_does_not_hold_up_the_camera() -> None:
    with open_rig("live", plant=TINY, camera={"rate_hz": 1000.0}) as link:
        link.reset(START, run_key="a")
        began_s = time.monotonic()
        link.control_cycle(NEUTRAL, t_s=0.0, hold_s=0.05)
        time.sleep(0.5)
        while link.loss.received <= 100 and time.monotonic() < began_s + 20.0:
            time.sleep(0.05)
        assert link.loss.received > 100
        frames = link.control_cycle(NEUTRAL, t_s=time.monotonic() - began_s + 0.1, hold_s=0.05)
        assert len(frames) > 100
        assert link.loss.lost == 0
