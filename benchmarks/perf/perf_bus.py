"""What the bus costs beside bare Zenoh on the same endpoints with messages of the same size, and what it can carry.

Round trip: a command from the runner's link to an AGV adapter, frames from a mocap adapter back; against two bare
publishers and subscribers that pass the same bytes. The adapters answer at once, so that nothing but the bus is timed.
Ours and the peer take turns in blocks; the ratio is the median of the blocks' ratios of medians. Between two processes
the other one is started several times, ours and the peer declared in either order: which is first, and how the
threads happen to lie on the cores, makes up to 10 % for a whole launch.

Coding: size, encoding and decoding of one message, checks included, in a loop that does nothing else.

Load: 25 mocap adapters in one process, each publishing a frame when it comes (all that have come, if it falls behind),
and one recorder with a thread for each vehicle.
"""

from __future__ import annotations

import argparse
import itertools
import socket
import statistics
import subprocess
import sys
import threading
import time
import timeit
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import Any, NamedTuple

import msgspec
import numpy as np
import zenoh

from agvbench.adapters.agv_host import AgvHost
from agvbench.adapters.contract import AdapterOptions, AgvAdapter, MocapAdapter, MocapReports
from agvbench.adapters.mocap_host import MocapHost
from agvbench.bus.clock import WallClock
from agvbench.bus.inbox import Inbox
from agvbench.bus.keys import Keys
from agvbench.bus.link import VehicleLink
from agvbench.bus.messages.codec import decoder, encode
from agvbench.bus.messages.command import CommandMessage, decode_command
from agvbench.bus.messages.frames import FrameClock, FramesFlags, FramesMessage, pack_columns
from agvbench.bus.messages.identity import AgvIdentity, MocapIdentity
from agvbench.bus.messages.request import Reset, Sampling
from agvbench.bus.outbox import CommandOutbox
from agvbench.bus.session import open_bus_session
from agvbench.errors import LinkError
from agvbench.types import Command, Frames, Pose
from agvbench.vehicle.channels import Channels

BOUND = 1.2
QOS = {
    "congestion_control": zenoh.CongestionControl.BLOCK,
    "priority": zenoh.Priority.REAL_TIME,
    "express": True,
}
VEHICLES = 25
RUN = FrameClock.RUN
COMMAND = CommandMessage(100_000, 12.5, Command(1700.0, 1500.0, 1500.0), 0.8, 0, 1 << 31)


def frames_of(count: int) -> Frames:
    """Return `count` plausible frames."""
    column = np.arange(count) / 120.0
    return Frames(
        column, column, column, column, np.ones(count, np.bool_), np.arange(count), column, np.full(count, np.nan)
    )


def frames_message(count: int) -> FramesMessage:
    """Return a message with `count` frames, with numbers as large as those of a long session."""
    return FramesMessage(100_000, count, pack_columns(frames_of(count)), 100_000, RUN, 1.25, FramesFlags.LAST, 1 << 31)


def frames_bytes(count: int) -> int:
    """Return the size of a message with `count` frames."""
    return len(encode(frames_message(count)))


class EchoAgv(AgvAdapter):
    """Has a camera answer a command at once: its ``front`` says with how many frames, which were made before."""

    scheme = "echo"

    def __init__(self, camera: MocapReports) -> None:
        self._frame, self._frames, self._batch = camera.frame, camera.frames, frames_of(96)

    @classmethod
    def open(cls, address: str, options: AdapterOptions) -> EchoAgv:
        """Refuse: it needs a camera."""
        raise NotImplementedError

    def identity(self) -> AgvIdentity:
        """Return the identity."""
        return AgvIdentity("agv1", "echo", "", "", Channels.alike("us", 0.0), simulated=True, lock_step=True)

    def apply(self, message: CommandMessage) -> None:
        """Have the camera publish."""
        if message.command.front == 1.0:
            self._frame(0.0, 0.0, 0.0, 0.0, clock=RUN, acknowledged=message.sequence)
        else:
            self._frames(self._batch, clock=RUN, acknowledged=message.sequence)

    def reset(self, request: Reset) -> None:
        """Do nothing."""

    def stop(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


class EchoMocap(MocapAdapter):
    """Publishes nothing by itself."""

    scheme = "echo"

    @classmethod
    def open(cls, address: str, options: AdapterOptions) -> EchoMocap:
        """Return one."""
        return cls()

    def identity(self) -> MocapIdentity:
        """Return the identity."""
        return MocapIdentity("echo", 120.0, simulated=True)

    def start(self, reports: Any) -> None:
        """Do nothing."""

    def reset(self, request: Reset) -> Sampling:
        """Begin a run."""
        return Sampling(120.0, 0.0)

    def close(self) -> None:
        """Do nothing."""


@contextmanager
def echo_node(session: zenoh.Session, *, bare_first: bool = False) -> Iterator[None]:
    """Host the echoing adapters, and the bare peer that does the same with bytes."""
    nodes = (bare_echo, our_echo) if bare_first else (our_echo, bare_echo)
    with nodes[0](session), nodes[1](session):
        yield


@contextmanager
def our_echo(session: zenoh.Session) -> Iterator[None]:
    """Host adapters that answer at once."""
    keys, clock = Keys("perf", "agv1"), WallClock()
    camera_host = MocapHost(session, keys, EchoMocap(), clock, listens_for_truth=False)
    vehicle_host = AgvHost(session, keys, EchoAgv(camera_host), clock, camera_host.see)
    try:
        yield
    finally:
        vehicle_host.close()
        camera_host.close()


@contextmanager
def bare_echo(session: zenoh.Session) -> Iterator[None]:
    """Do the same with bytes."""
    subscriber = session.declare_subscriber("bare/command", zenoh.handlers.FifoChannel(256))
    publisher = session.declare_publisher("bare/frames", **QOS)
    answers = {count: bytes(frames_bytes(count)) for count in (1, 96)}

    def echo() -> None:
        handler = subscriber.handler
        while True:
            try:
                command = handler.recv().payload.to_bytes()
            except zenoh.ZError:
                return
            publisher.put(answers[command[0]])

    thread = threading.Thread(target=echo, daemon=True)
    thread.start()
    try:
        yield
    finally:
        subscriber.undeclare()
        thread.join()
        publisher.undeclare()


class Plan(NamedTuple):
    """How often to measure, and how long to pause in between."""

    name: str
    blocks: int
    times: int
    pause_s: float


def median_s(call: Callable[[], object], plan: Plan) -> float:
    """Return the median time of a call."""
    taken = []
    for _ in range(plan.times):
        time.sleep(plan.pause_s)
        began = time.perf_counter()
        call()
        taken.append(time.perf_counter() - began)
    return statistics.median(taken)


class Table:
    """What was measured, by row: blocks of medians, ours and the peer's [s]."""

    def __init__(self) -> None:
        self._rows: dict[tuple[str, float | None], list[tuple[float, float]]] = {}

    def compare(
        self, what: str, ours: Callable[[], object], bare: Callable[[], object], plan: Plan, bound: float | None
    ) -> None:
        """Let ours and the peer take turns in blocks."""
        blocks = self._rows.setdefault((what, bound), [])
        blocks += [(median_s(ours, plan), median_s(bare, plan)) for _ in range(plan.blocks)]

    def report(self) -> None:
        """Print the medians and the median ratio of every row, and forget them."""
        for (what, bound), blocks in self._rows.items():
            mine, peer = (statistics.median(column) * 1e6 for column in zip(*blocks, strict=True))
            ratio = statistics.median(own / other for own, other in blocks)
            verdict = "" if bound is None else f"≤ {bound}  {'yes' if ratio <= bound else 'no'}"
            print(f"{what:56s} {mine:8.1f} µs {peer:8.1f} µs {ratio:7.2f}  {verdict}", flush=True)
        self._rows.clear()


def round_trips(table: Table, session: zenoh.Session, where: str, plans: list[Plan]) -> None:
    """Measure the codec's and numbering's round trip beside bare Zenoh's, for one frame and for 0.8 s at 120 Hz."""
    keys = Keys("perf", "agv1")
    inbox, outbox = Inbox(session, keys), CommandOutbox(session, keys)
    with bare_peer(session) as bare:
        for plan, count in itertools.product(plans, (1, 96)):
            command = Command(0.0, float(count), 0.0)

            def ours(command: Command = command) -> object:
                outbox.send(command, 0.0, 0.8)
                return inbox.receive()

            table.compare(label("round trip", where, plan, count), ours, bare(count), plan, BOUND)
    inbox.close()
    outbox.close()


def lock_steps(table: Table, session: zenoh.Session, where: str, plans: list[Plan]) -> None:
    """Measure whole exchanges, with their clocks, watchdog and checks, beside bare Zenoh's round trip."""
    with VehicleLink(session, "perf", "agv1") as link, bare_peer(session) as bare:
        link.reset(Pose(0.0, 0.0, 0.0), run_key="a")
        for plan, count in itertools.product(plans, (1, 96)):
            command = Command(0.0, float(count), 0.0)

            def ours(command: Command = command) -> object:
                return link.control_cycle(command, t_s=0.0, hold_s=0.8)

            table.compare(label("exchange", where, plan, count), ours, bare(count), plan, None)


def coding() -> None:
    """Print the size of messages, and how long they take to be encoded and decoded."""
    decode_frames = decoder(FramesMessage)
    cases: list[tuple[str, Callable[[], bytes], Callable[[bytes], object]]] = [
        ("command", lambda: encode(CommandMessage(*msgspec.structs.astuple(COMMAND))), decode_command)
    ]
    for count in (1, 96):
        frames = frames_of(count)
        cases.append((
            f"frames, {count}",
            lambda frames=frames: encode(FramesMessage(1, len(frames), pack_columns(frames))),  # type: ignore[misc]
            lambda payload: decode_frames(payload).frames(),
        ))  # fmt: skip
    for name, make, read in cases:
        payload = make()
        made_us, read_us = best_us(make), best_us(partial(read, payload))
        print(f"coding, {name:20s} {len(payload):6d} B, {made_us:6.2f} µs encoded, {read_us:6.2f} µs decoded")


def best_us(call: Callable[[], object]) -> float:
    """Return the shortest mean time [µs] of 2000 calls, of seven."""
    return min(timeit.repeat(call, number=2000, repeat=7)) / 2000 * 1e6


def label(what: str, where: str, plan: Plan, count: int) -> str:
    """Return what a row is about."""
    return f"{what}, {where}, {plan.name}, {count} frame{'s' * (count > 1)}"


@contextmanager
def bare_peer(session: zenoh.Session) -> Iterator[Callable[[int], Callable[[], object]]]:
    """Give what makes the peer's round trip for a number of frames."""
    subscriber = session.declare_subscriber("bare/frames", zenoh.handlers.FifoChannel(256))
    publisher = session.declare_publisher("bare/command", **QOS)
    handler = subscriber.handler

    def for_count(count: int) -> Callable[[], object]:
        payload = bytes([count]) * len(encode(COMMAND))

        def bare() -> bytes:
            publisher.put(payload)
            return bytes(handler.recv().payload.to_bytes())

        while not publisher.matching_status.matching:
            time.sleep(0.01)
        assert len(bare()) == frames_bytes(count)
        return bare

    yield for_count
    subscriber.undeclare()
    publisher.undeclare()


def publish_load(endpoint: str, rate_hz: float, duration_s: float) -> None:
    """Publish for each of 25 vehicles what frames have come since the last time; say how many and how long it took."""
    with ExitStack() as stack:
        session = stack.enter_context(open_bus_session(connect=[endpoint]))
        clock, hosts = WallClock(), []
        for number in range(VEHICLES):
            keys, adapter = Keys("perf", f"agv{number}"), EchoMocap()
            hosts.append(MocapHost(session, keys, adapter, clock, listens_for_truth=False))
            stack.callback(hosts[-1].close)
        print("ready", flush=True)
        sys.stdin.readline()
        everything, ticks, done, messages = frames_of(1000), round(rate_hz * duration_s), 0, 0
        began = time.perf_counter()
        while done < ticks:
            due = min(ticks, done + len(everything), int((time.perf_counter() - began) * rate_hz) + 1)
            if due == done:
                time.sleep(max(0.0, began + done / rate_hz - time.perf_counter()))
                continue
            frames = everything.select(np.arange(due - done))
            for host in hosts:
                host.frames(frames, clock=FrameClock.ADAPTER)
            done, messages = due, messages + VEHICLES
        print(ticks * VEHICLES, messages, time.perf_counter() - began, flush=True)
        sys.stdin.readline()


class Recorder:
    """Receives the frames of all vehicles, a thread each, and counts."""

    def __init__(self, session: zenoh.Session) -> None:
        self.inboxes = [Inbox(session, Keys("perf", f"agv{number}")) for number in range(VEHICLES)]
        self.frames = [0] * VEHICLES
        self._threads = [threading.Thread(target=self._record, args=(n,), daemon=True) for n in range(VEHICLES)]
        for thread in self._threads:
            thread.start()

    def _record(self, number: int) -> None:
        while True:
            try:
                report = self.inboxes[number].receive()
            except LinkError:
                return
            if isinstance(report, FramesMessage):
                self.frames[number] += report.count

    @property
    def lost(self) -> int:
        """How many messages the sequence numbers say are missing."""
        return sum(inbox.frames_loss.lost for inbox in self.inboxes)

    def close(self) -> None:
        """Stop."""
        for inbox in self.inboxes:
            inbox.close()
        for thread in self._threads:
            thread.join()


def child(*arguments: str) -> subprocess.Popen[str]:
    """Start this script as another process; return when it is ready."""
    process = subprocess.Popen(  # noqa: S603
        [sys.executable, __file__, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


def load(endpoint: str, rate_hz: float, duration_s: float) -> None:
    """Print what arrived of the load, and whether anything was lost without being counted."""
    with open_bus_session(listen=[endpoint]) as session:
        recorder = Recorder(session)
        process = child("--load", endpoint, str(rate_hz), str(duration_s))
        assert process.stdin is not None
        assert process.stdout is not None
        print(file=process.stdin, flush=True)
        sent, messages, taken_s = process.stdout.readline().split()
        deadline = time.perf_counter() + 10.0
        while sum(recorder.frames) + recorder.lost < int(sent) and time.perf_counter() < deadline:
            time.sleep(0.01)
        print(file=process.stdin, flush=True)
        process.wait()
        received, lost = sum(recorder.frames), recorder.lost
        recorder.close()
    rate = int(sent) / float(taken_s)
    silent = int(sent) - received - lost
    met = "yes" if silent == 0 and (lost == 0 or rate_hz > 240.0) else "no"
    what = f"{VEHICLES} vehicles at {rate_hz:g} Hz for {duration_s:g} s"
    share = rate / (VEHICLES * rate_hz)
    print(
        f"{what:30s} {received} of {sent} frames, {lost} lost and counted, {silent} silently; "
        f"{int(messages)} messages, {rate:.0f} frames/s, {share:.0%} of the rate; none silent: {met}",
        flush=True,
    )


def free_endpoint() -> str:
    """Return a free loopback endpoint."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--full", action="store_true", help="load for 60 s instead of 5 s, and more round trips")
    parser.add_argument("--quick", action="store_true", help="fewer round trips, load for 1 s")
    parser.add_argument("--echo", metavar="ENDPOINT", help=argparse.SUPPRESS)
    parser.add_argument("--bare-first", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--load", nargs=3, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.echo:
        with (
            open_bus_session(listen=[arguments.echo]) as session,
            echo_node(session, bare_first=arguments.bare_first),
        ):
            print("ready", flush=True)
            sys.stdin.readline()
        return
    if arguments.load:
        endpoint, rate_hz, duration_s = arguments.load
        publish_load(endpoint, float(rate_hz), float(duration_s))
        return
    more = 1 if arguments.quick else 9 if arguments.full else 4
    plans = [Plan("back to back", 5 * more, 100, 0.0), Plan("at 240 Hz", 3 * more, 40, 1 / 240.0)]
    few = [Plan("back to back", 5, 100, 0.0), Plan("at 240 Hz", 3, 40, 1 / 240.0)]
    coding()
    print(f"{'what':56s} {'ours':>11s} {'bare Zenoh':>11s} {'ratio':>7s}  bound  met?")
    table = Table()
    with open_bus_session() as session, echo_node(session):
        round_trips(table, session, "one session", plans)
        lock_steps(table, session, "one session", plans)
    table.report()
    for launch in range(4 * more):
        endpoint = free_endpoint()
        process = child("--echo", endpoint, *(["--bare-first"] if launch % 2 else []))
        with open_bus_session(connect=[endpoint]) as session:
            round_trips(table, session, "two processes", few)
            lock_steps(table, session, "two processes", few)
        process.communicate("\n")
    table.report()
    duration_s = 60.0 if arguments.full else 1.0 if arguments.quick else 5.0
    load(free_endpoint(), 240.0, duration_s)
    load(free_endpoint(), 2400.0, duration_s)


if __name__ == "__main__":
    main()
