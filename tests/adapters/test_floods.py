"""More than anybody sends who means well: what arrives is counted, memory stays bounded, and a stop gets through."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable

import numpy as np
import pytest
import zenoh
from test_real_time import MOVING, NEUTRAL, Silent, claimed_host

from agvbench.bus.clock import WallClock
from agvbench.bus.inbox import Inbox
from agvbench.bus.keys import AGV, TIME, Keys
from agvbench.bus.liveliness import Liveliness
from agvbench.bus.messages.codec import MAX_MESSAGE_BYTES, MAX_ROWS, encode
from agvbench.bus.messages.command import CommandFlags, CommandMessage, decode_command
from agvbench.bus.messages.event import Event, Level
from agvbench.bus.messages.frames import FrameClock, FramesFlags, FramesMessage, pack_columns
from agvbench.bus.outbox import CommandOutbox
from agvbench.bus.queries import ask
from agvbench.bus.real_time import RealTime
from agvbench.bus.session import open_bus_session
from agvbench.errors import LinkError, MessageError
from agvbench.types import Frames

pytestmark = pytest.mark.real_time

KEYS = Keys("lab", "agv1")


class Slow(Silent):
    """A vehicle that takes longer over a command than the next one takes to come, as a serial line does."""

    def apply(self, message: CommandMessage) -> None:
        super().apply(message)
        time.sleep(0.005)


@pytest.fixture
def free_endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def until(condition: Callable[[], bool]) -> bool:
    deadline_s = time.monotonic() + 10.0
    while not condition() and time.monotonic() < deadline_s:
        time.sleep(0.005)
    return condition()


def kinds(told: list[bytes]) -> list[bytes]:
    return [next((kind for kind in (b"commands_overtaken", b"MessageError") if kind in one), b"") for one in told]


def test_a_stop_passes_commands_that_wait() -> None:
    adapter, told = Slow(), []
    with open_bus_session() as session:
        events = session.declare_subscriber(KEYS.report, lambda sample: told.append(sample.payload.to_bytes()))
        host = claimed_host(session, KEYS, adapter, 7)
        for number in range(1, 2001):
            session.put(KEYS.command, encode(CommandMessage(number, 0.0, MOVING, 10.0, CommandFlags.NONE, 7)))
        session.put(KEYS.command, encode(CommandMessage(2001, 0.0, NEUTRAL, 0.0, CommandFlags.STOP, 7)))
        assert adapter.stopped.wait(10.0)
        applied = len(adapter.applied)
        host.close()
        events.undeclare()
    # Each of 2000 would have taken 5 ms; of every 256 that waited, the newest was carried out.
    assert applied < 400
    assert host.reordered.count == 2000 - applied
    assert host.loss.lost == 0
    assert 1 <= kinds(told).count(b"commands_overtaken") <= 3


def test_a_stop_between_commands_that_wait_is_carried_out_and_so_is_what_came_after() -> None:
    adapter = Slow()
    with open_bus_session() as session:
        host = claimed_host(session, KEYS, adapter, 7)
        flags = [CommandFlags.NONE] * 50 + [CommandFlags.STOP] + [CommandFlags.NONE] * 50
        for number, flag in enumerate(flags, start=1):
            session.put(KEYS.command, encode(CommandMessage(number, 0.0, MOVING, 10.0, flag, 7)))
        assert adapter.stopped.wait(10.0)
        assert until(lambda: bool(adapter.applied) and adapter.applied[-1].sequence == 101)
        host.close()


def test_nonsense_is_counted_told_seldom_and_does_not_hold_up_a_stop() -> None:
    adapter, told = Silent(), []
    with open_bus_session() as session:
        events = session.declare_subscriber(KEYS.report, lambda sample: told.append(sample.payload.to_bytes()))
        host = claimed_host(session, KEYS, adapter, 7)
        for _ in range(5000):
            session.put(KEYS.command, b"nonsense")
        session.put(KEYS.command, encode(CommandMessage(1, 0.0, NEUTRAL, 0.0, CommandFlags.STOP, 7)))
        assert adapter.stopped.wait(10.0)
        assert host.malformed.count == 5000
        host.close()
        events.undeclare()
    assert kinds(told).count(b"MessageError") == 4  # the first, 10th, 100th and 1000th


def test_what_a_runner_keeps_of_a_flood_is_bounded_and_its_stop_goes_out() -> None:
    stopped = threading.Event()

    def heard(sample: object) -> None:
        if decode_command(sample.payload.to_bytes()).flags & CommandFlags.STOP:  # type: ignore[attr-defined]
            stopped.set()

    numbers = np.zeros(MAX_ROWS)
    many = Frames(numbers, numbers, numbers, numbers, numbers == 0.0, np.zeros(MAX_ROWS, np.int64), numbers, numbers)
    columns = pack_columns(many)
    with open_bus_session() as session:
        vehicle = session.declare_subscriber(KEYS.command, heard)
        inbox, outbox = Inbox(session, KEYS), CommandOutbox(session, KEYS)
        liveliness = Liveliness(session, KEYS, WallClock())
        runner = RealTime(inbox, outbox, liveliness, session=session, keys=KEYS, neutral=NEUTRAL, clock=WallClock())
        for number in range(1, 101):
            frames = FramesMessage(number, MAX_ROWS, columns, 0, FrameClock.ADAPTER, 0.0, FramesFlags.LAST, 5)
            session.put(KEYS.report, encode(frames))
            session.put(KEYS.report, b"nonsense")
            event = Event(number, f"role-{number}", Level.INFO, "noise", "x" * 4000)
            session.put(KEYS.report, encode(event))
        runner.stop()
        assert stopped.wait(10.0)
        assert until(lambda: inbox.malformed.count == 100)
        kept = sum(len(message.columns) for _, message in runner._arrived)
        assert kept <= 16 << 20
        assert len(runner._arrived) + runner.dropped.count == 100
        assert runner.dropped.count > 0
        assert set(inbox.event_losses) == {"agv", "mocap"}
        texts = [event.text for event in inbox.events if event.role == "runner"]
        assert sum("100 so far" in text for text in texts) == 1
        assert any("frames that the runner did not take were dropped" in text for text in texts)
        for closed in (liveliness, outbox, inbox):
            closed.close()
        runner.close()
        vehicle.undeclare()


def test_an_outbox_closes_while_another_thread_is_inside_a_send() -> None:
    sent: list[int] = []

    def send() -> None:
        sent.append(outbox.send(MOVING, 0.0, 1.0))
        sent.append(outbox.send(MOVING, 0.1, 1.0))

    with open_bus_session() as session:
        takes_nothing = session.declare_subscriber(KEYS.command, zenoh.handlers.FifoChannel(1))
        outbox = CommandOutbox(session, KEYS)
        sender = threading.Thread(target=send)
        sender.start()
        assert until(lambda: bool(sent))
        time.sleep(0.3)  # it waits for the receiver now
        assert sender.is_alive()
        outbox.close()
        with pytest.raises(LinkError, match="the bus was closed"):
            outbox.send(MOVING, 0.0, 1.0)
        while takes_nothing.try_recv() is not None or sender.is_alive():
            time.sleep(0.01)
        takes_nothing.undeclare()
    assert len(sent) == 2


def test_tokens_of_roles_that_do_not_exist_are_not_remembered() -> None:
    with open_bus_session() as session:
        liveliness = Liveliness(session, KEYS, WallClock())
        tokens = [session.liveliness().declare_token(KEYS.alive(f"role-{number}")) for number in range(200)]
        token = session.liveliness().declare_token(KEYS.alive(AGV))
        liveliness.wait_for(AGV, 10.0)
        assert set(liveliness._present) == {AGV}
        for one in (*tokens, token):
            one.undeclare()
        liveliness.close()


def test_an_answer_that_never_ends_is_not_read_to_its_end() -> None:
    with open_bus_session() as session:
        asked = session.declare_queryable(KEYS.queryable(AGV, TIME))
        given = threading.Event()

        def answer() -> None:
            with asked.handler.recv() as query:
                for _ in range(100):
                    query.reply_err(b"not this")
                given.wait(20.0)  # the query stays open

        thread = threading.Thread(target=answer)
        thread.start()
        with pytest.raises(Exception, match="no answer"):
            ask(session, KEYS.queryable(AGV, TIME), b"", 15.0)
        assert not given.is_set()
        given.set()
        thread.join()


def test_messages_that_are_too_long_do_not_arrive_and_the_rest_does(free_endpoint: str) -> None:
    arrived: list[int] = []
    with open_bus_session(listen=[free_endpoint]) as here, open_bus_session(connect=[free_endpoint]) as there:
        subscriber = here.declare_subscriber("x", lambda sample: arrived.append(len(sample.payload.to_bytes())))
        assert until(lambda: bool(list(here.info.transports())))
        publisher = there.declare_publisher("x", congestion_control=zenoh.CongestionControl.BLOCK)
        assert until(lambda: publisher.matching_status.matching)
        for size in (2 * MAX_MESSAGE_BYTES, 3 * MAX_MESSAGE_BYTES, MAX_MESSAGE_BYTES, 1):
            publisher.put(bytes(size))
        assert until(lambda: len(arrived) == 2)
        subscriber.undeclare()
    assert arrived == [MAX_MESSAGE_BYTES, 1]


def test_a_replay_of_endless_commands_is_refused() -> None:
    from agvbench.bus.messages.request import Replay, Reset, Sampling, decode_replay
    from agvbench.types import Commands, Pose

    t_s = np.arange(float(MAX_ROWS))
    reset = Reset("run", Pose(0.0, 0.0, 0.0), Sampling(120.0, 0.0))
    payload = encode(Replay(reset, Commands(t_s, t_s, t_s, t_s), 0.0))
    size, more = (8 * MAX_ROWS).to_bytes(4, "big"), (8 * MAX_ROWS + 8).to_bytes(4, "big")
    longer = payload.replace(size, more).replace(t_s.tobytes(), t_s.tobytes() + np.float64(MAX_ROWS).tobytes())
    with pytest.raises(MessageError, match="too many commands to replay"):
        decode_replay(longer)
