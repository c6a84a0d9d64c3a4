"""A client and an emulated server over UDP on loopback: every version, unicast and multicast."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from streams import VERSIONS, drawn

from agvbench.adapters.natnet.channel import Channel, Connection, Counters
from agvbench.adapters.natnet.client import Client, Seen
from agvbench.adapters.natnet.clock_sync import MAX_DRIFT, ClockSync
from agvbench.adapters.natnet.emulator import MAX_CLIENTS, Emulator, Settings
from agvbench.adapters.natnet.protocol.bitstream import Version
from agvbench.adapters.natnet.protocol.encode import encode_frame
from agvbench.adapters.natnet.protocol.frame import MODELS_CHANGED
from agvbench.adapters.natnet.protocol.packet import Message, join
from agvbench.bus.clock import SimulatedClock, WallClock
from agvbench.errors import AdapterGoneError, LinkError

pytestmark = pytest.mark.real_time

GROUP = "239.255.42.99"
FRAME, MODELS = drawn()


def free_port() -> int:
    """Return a UDP port that nobody uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def until(condition: Callable[[], Any], limit_s: float = 5.0) -> None:
    """Wait for something, and fail if it does not come."""
    deadline = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.005)


class Lab:
    """A server, a client, and what it saw."""

    def __init__(self, stack: ExitStack) -> None:
        self._stack, self.seen = stack, list[Seen]()

    def open(self, settings: Settings, version: Version | None = None, port: int | None = None) -> None:
        """Start both."""
        self.server = Emulator(settings, MODELS)
        self._stack.callback(self.server.close)
        host, own = self.server.address
        # Before 3.0 a server does not say which group it sends to.
        group, data_port = (settings.multicast, settings.data_port) if settings.version < (3, 0) else (None, None)
        connection = Connection(host, port or own, "127.0.0.1", version, group, data_port)
        self.client = Client(connection, WallClock(), self.seen.append)
        self._stack.callback(self.client.close)
        self.client.start()

    def send(self, number: int, exposed_s: float | None = None, flags: int = 0) -> None:
        """Stream the frame under another number."""
        ticks = self.server.ticks(exposed_s)
        self.server.send(FRAME._replace(number=number, exposed_ticks=ticks, flags=flags))


@pytest.fixture
def lab() -> Iterator[Lab]:
    """Give a lab that is closed afterwards."""
    with ExitStack() as stack:
        yield Lab(stack)


@pytest.mark.parametrize("version", VERSIONS, ids=str)
@pytest.mark.parametrize("multicast", [None, GROUP])
def test_poses_arrive_in_every_version(lab: Lab, version: Version, multicast: str | None) -> None:
    lab.open(Settings(version, multicast=multicast, data_port=free_port()))
    for number in range(1, 4):
        lab.send(number)
    until(lambda: len(lab.seen) == 3)
    for one in lab.seen:
        assert np.array_equal(one.frame.bodies["position_m"], FRAME.bodies["position_m"])
        assert np.array_equal(one.frame.bodies["quaternion"], FRAME.bodies["quaternion"])
    until(lambda: lab.client.names == {model.name: model.id for model in MODELS})
    assert lab.client.rate_hz == 120.0
    assert (lab.client.counters.frames, lab.client.counters.lost, lab.client.counters.malformed) == (3, 0, 0)


def test_another_version_can_be_asked_for(lab: Lab) -> None:
    lab.open(Settings(Version(4, 2)), Version(4, 0))
    lab.send(1)
    until(lambda: lab.seen)
    assert lab.client.version == (4, 0)
    assert np.array_equal(lab.seen[0].frame.bodies["position_m"], FRAME.bodies["position_m"])


def test_an_old_server_streams_in_its_own_version(lab: Lab) -> None:
    with pytest.raises(LinkError, match=r"streams in its own version only: 3.1 \(limit: 4.0 was asked for\)"):
        lab.open(Settings(Version(3, 1)), Version(4, 0))


def test_frames_that_are_missing_late_or_doubled_are_counted(lab: Lab) -> None:
    lab.open(Settings())
    for number in (1, 2, 2, 5, 4, 6):
        lab.send(number)
    until(lambda: lab.client.counters.repeated == 2 and lab.client.counters.frames == 4)
    assert [one.frame.number for one in lab.seen] == [1, 2, 5, 6]
    assert lab.client.counters.lost == 2


def test_names_are_asked_for_again_when_they_change(lab: Lab) -> None:
    lab.open(Settings())
    lab.send(1)
    until(lambda: lab.client.names.get("agv1") == 1)
    lab.server.describe([model.__class__(model.id, f"blue{model.id}", model.markers_m) for model in MODELS])
    lab.send(2, flags=MODELS_CHANGED)
    until(lambda: "blue1" in lab.client.names)
    assert lab.client.names == {"blue1": 1, "blue2": 2, "blue3": 3}


@pytest.mark.parametrize("drift", [-50e-6, 0.0, 50e-6])
def test_capture_times_are_within_their_stated_uncertainty(lab: Lab, drift: float) -> None:
    lab.open(Settings(drift=drift, offset_s=12_345.0))
    clock_hz = lab.server.settings.clock_hz
    until(lambda: lab.client.sync.host_time(lab.server.ticks() / clock_hz).uncertainty_s < 0.09)
    rng, true_s = np.random.default_rng(0), []
    for number in range(1, 101):
        exposed_s = time.monotonic()
        time.sleep(float(rng.exponential(0.002)))  # the camera computes, the network lets it wait
        true_s.append(exposed_s)
        lab.send(number, exposed_s)
    until(lambda: len(lab.seen) == 100)
    errors = np.array([one.captured.time_s for one in lab.seen]) - true_s
    bounds = np.array([one.captured.uncertainty_s for one in lab.seen])
    assert (np.abs(errors) <= bounds).all()
    assert (bounds < 0.1).all()


@given(
    st.floats(-MAX_DRIFT / 2, MAX_DRIFT / 2),
    st.floats(0.0, 1e6),
    st.lists(st.tuples(st.floats(0.0, 0.05), st.floats(0.0, 0.05), st.floats(0.01, 5.0)), min_size=1, max_size=80),
)
def test_the_bound_holds_whatever_the_network_does(
    drift: float, offset_s: float, echoes: list[tuple[float, float, float]]
) -> None:
    sync, now_s = ClockSync(), 100.0
    for there_s, back_s, pause_s in echoes:
        server_s = (now_s + there_s) * (1.0 + drift) + offset_s
        sync.echoed(now_s, now_s + there_s + back_s, server_s)
        now_s += there_s + back_s + pause_s
    stamp = sync.host_time((now_s - 0.3) * (1.0 + drift) + offset_s)
    assert abs(stamp.time_s - (now_s - 0.3)) <= stamp.uncertainty_s + 1e-8


def test_frames_of_other_sockets_on_the_servers_machine_are_no_poses(lab: Lab) -> None:
    lab.open(Settings())
    (address,) = lab.server.clients()
    lab.send(1)
    until(lambda: len(lab.seen) == 1)
    made_up = encode_frame(FRAME._replace(number=2), lab.client.version)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for payload in (join(Message.FRAMEOFDATA, made_up), join(Message.ECHO_RESPONSE, bytes(16))):
            stranger.sendto(payload, address)
    until(lambda: lab.client.counters.foreign == 2)
    lab.send(3)
    until(lambda: len(lab.seen) == 2)
    assert [one.frame.number for one in lab.seen] == [1, 3]


class Wire:
    """A channel, its server, and two more sockets on the server's machine."""

    def __init__(self, stack: ExitStack) -> None:
        self.server, self.data, self.another = (
            stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(3)
        )
        self.server.bind(("127.0.0.1", 0))
        port = self.server.getsockname()[1]
        self.counters = Counters()
        self.channel = Channel(Connection("127.0.0.1", port, "127.0.0.1", data_port=free_port()), self.counters)
        stack.callback(self.channel.close)
        self.channel.send(Message.KEEPALIVE)
        self.client = self.server.recvfrom(100)[1]

    def takes(self, sender: socket.socket) -> bool:
        """Whether the channel takes a frame of this sender; it counts those that it does not."""
        before = self.counters.foreign
        sender.sendto(join(Message.FRAMEOFDATA, bytes(40)), self.client)
        arrived = self.channel.arrived(5.0)
        assert len(arrived) + self.counters.foreign - before == 1
        return bool(arrived)


def test_in_unicast_frames_are_taken_from_the_announced_ports_only() -> None:
    with ExitStack() as stack:
        wire = Wire(stack)
        assert [wire.takes(one) for one in (wire.data, wire.another, wire.server)] == [False, False, True]
        assert wire.counters.foreign_port == wire.another.getsockname()[1]
        wire.channel.ports.add(wire.data.getsockname()[1])
        assert wire.takes(wire.data)


def test_in_multicast_frames_from_one_other_port_are_taken_where_none_come_from_the_announced_ones() -> None:
    with ExitStack() as stack:
        wire = Wire(stack)
        wire.channel._clock = clock = SimulatedClock()  # type: ignore[assignment]
        wire.channel.join(GROUP, free_port())
        assert not wire.takes(wire.data)
        clock.sleep(2.5)
        senders = (wire.data, wire.another, wire.data, wire.server, wire.data)
        assert [wire.takes(one) for one in senders] == [True, False, True, True, False]
        clock.sleep(2.5)
        assert not wire.takes(wire.data)


def test_foreign_and_malformed_packets_are_counted_and_do_no_harm(lab: Lab) -> None:
    lab.open(Settings())
    (address,) = lab.server.clients()
    lab.server._send(b"\x07\x00\xff\xff", address)
    lab.server._send(join(Message.FRAMEOFDATA, b"\xff" * 40), address)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind(("127.0.0.2", 0))
        stranger.sendto(join(Message.FRAMEOFDATA, bytes(200)), address)
    lab.send(1)
    until(lambda: len(lab.seen) == 1 and lab.client.counters.foreign == 1)
    assert lab.client.counters.malformed == 2
    assert lab.client.counters.first_malformed


def test_a_flood_of_datagrams_is_counted_and_frames_go_on(lab: Lab) -> None:
    lab.open(Settings())
    (address,) = lab.server.clients()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind(("127.0.0.2", 0))
        for number in range(1, 11):
            for _ in range(200):
                stranger.sendto(b"\xff" * 100, address)
                lab.server._send(b"\x07\x00\xff\xff", address)
            lab.send(number)
    until(lambda: len(lab.seen) == 10)
    until(lambda: (lab.client.counters.foreign, lab.client.counters.malformed) == (2000, 2000))
    assert lab.client.counters.lost == 0


def test_a_server_remembers_so_many_clients_and_no_more() -> None:
    server = Emulator(Settings(), MODELS, threaded=False)
    connect = join(Message.CONNECT, b"Ping\0")
    strangers = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(MAX_CLIENTS + 5)]
    for stranger in strangers:
        stranger.sendto(connect, server.address)
        assert server.step(5.0)
    assert len(server.clients()) == MAX_CLIENTS
    for stranger in strangers:
        stranger.close()
    server.close()


@pytest.mark.parametrize("rate_hz", [float("inf"), float("nan"), -1.0, 0.0, 1e9])
def test_a_frame_rate_that_cannot_be_is_not_believed(lab: Lab, rate_hz: float) -> None:
    lab.open(Settings(rate_hz=rate_hz))
    assert np.isnan(lab.client.rate_hz)


@pytest.mark.parametrize("payload", [b"Ping\0", b"", bytes(264), bytes(269), bytes(271)])
def test_every_known_greeting_is_answered(payload: bytes) -> None:
    server = Emulator(Settings(), MODELS)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.settimeout(5.0)
        client.sendto(join(Message.CONNECT, payload), server.address)
        assert client.recv(2048)[:2] == b"\x01\x00"
        client.sendto(b"\x99\x00\x00\x00", server.address)
        assert client.recv(2048)[:2] == b"\x64\x00"
    server.close()


def test_a_server_that_is_not_there_is_one_clear_line() -> None:
    connection = Connection("127.0.0.1", free_port(), answer_limit_s=0.2)
    with pytest.raises(AdapterGoneError, match=r"^natnet:127.0.0.1:\d+: no NatNet server answers: waited 0.2 s; see "):
        Client(connection, WallClock(), print)
    with pytest.raises(LinkError, match="address cannot be used"):
        Client(Connection("127.0.0.1", 1510, local="192.0.2.1"), WallClock(), print)


@pytest.mark.parametrize("host", [".lab", "a..b", "x" * 70])
def test_a_name_that_can_be_no_host_is_one_clear_line(host: str) -> None:
    with pytest.raises(LinkError, match="address cannot be used"):
        Client(Connection(host, 1510), WallClock(), print)
