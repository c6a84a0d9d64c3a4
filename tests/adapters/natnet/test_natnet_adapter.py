"""The NatNet adapter on the bus: from UDP packets to frames in a runner's inbox."""

from __future__ import annotations

import itertools
import math
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest
from streams import drawn

from agvbench.adapters.contract import AdapterOptions
from agvbench.adapters.mocap.natnet import NatNetMocap
from agvbench.adapters.mocap_host import MocapHost
from agvbench.adapters.natnet.axes import from_floor
from agvbench.adapters.natnet.emulator import Emulator, Settings
from agvbench.adapters.natnet.options import NatNetOptions
from agvbench.adapters.natnet.protocol.bitstream import BODY
from agvbench.adapters.registry import open_mocap
from agvbench.bus.clock import WallClock
from agvbench.bus.inbox import Inbox
from agvbench.bus.keys import Keys
from agvbench.bus.messages.event import Event
from agvbench.bus.messages.frames import FramesMessage
from agvbench.bus.session import open_bus_session
from agvbench.errors import FlagError
from agvbench.types import Frames

pytestmark = pytest.mark.real_time

FRAME, MODELS = drawn()
POSES = np.array([[1.25, -0.5, 0.3], [0.0, 2.0, -3.0], [-1.0, 0.25, 1.5]])


class Bench:
    """A server, an adapter on the bus, and what a runner hears."""

    def __init__(self, stack: ExitStack, up: str = "y", **camera: Any) -> None:
        self.up = up
        self.server = Emulator(Settings(rate_hz=240.0), MODELS)
        stack.callback(self.server.close)
        host, port = self.server.address
        keys, session = Keys("lab", "agv2"), stack.enter_context(open_bus_session())
        self.inbox = Inbox(session, keys)
        stack.callback(self.inbox.close)
        options = AdapterOptions(vehicle="agv2", camera={"up": up, **camera}, clock=WallClock())
        adapter = open_mocap(f"natnet:{host}:{port}", options)
        assert isinstance(adapter, NatNetMocap)
        self.identity, self.client = adapter.identity(), adapter._client
        stack.callback(MocapHost(session, keys, adapter, WallClock(), listens_for_truth=False).close)

    def clock_known_to_s(self, limit_s: float) -> float:
        """Return what a stamp may be wrong by [s], once that is less than a limit: echoes may be slow."""
        deadline_s = time.monotonic() + 20.0
        while time.monotonic() < deadline_s:
            now_s = self.server.ticks() / self.server.settings.clock_hz
            if self.client.ready and (uncertainty_s := self.client.sync.host_time(now_s).uncertainty_s) < limit_s:
                return uncertainty_s
            time.sleep(0.01)
        pytest.fail(f"no echo came back within {limit_s} s")

    def send(self, numbers: range, flags: int = 1) -> float:
        """Stream frames; return the host's time of the first exposure."""
        bodies = np.zeros(len(POSES), BODY)
        bodies["id"], bodies["flags"], bodies["mean_error_m"] = np.arange(1, 4), flags, 0.00025
        bodies["position_m"], bodies["quaternion"] = from_floor(POSES, self.up, 0.1)  # type: ignore[arg-type]
        began_s = time.monotonic()
        for number in numbers:
            ticks = self.server.ticks(began_s + (number - numbers[0]) / 240.0)
            self.server.send(FRAME._replace(number=number, bodies=bodies, exposed_ticks=ticks))
        return began_s

    def frames(self, count: int) -> Frames:
        """Return so many frames."""
        parts: list[Frames] = []
        patience = threading.Timer(10.0, self.inbox.wake)
        patience.start()
        while sum(map(len, parts)) < count:
            report = self.inbox.receive()
            assert report is not None, "frames did not come"
            if isinstance(report, FramesMessage):
                parts.append(report.frames())
        patience.cancel()
        return Frames.concatenate(parts)


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    """Give what closes everything afterwards."""
    with ExitStack() as opened:
        yield opened


@pytest.mark.parametrize("up", ["y", "z"])
def test_a_body_is_seen_on_the_floor_when_it_was_exposed(stack: ExitStack, up: str) -> None:
    bench = Bench(stack, up)
    uncertainty_s = bench.clock_known_to_s(0.01)
    began_s = bench.send(range(1, 25))
    frames = bench.frames(24)
    assert np.allclose(frames.x_m, POSES[1, 0], atol=1e-6)
    assert np.allclose(frames.y_m, POSES[1, 1], atol=1e-6)
    assert np.allclose(frames.heading_rad, POSES[1, 2], atol=1e-6)
    assert np.allclose(frames.mean_error_m, 0.00025)
    # A better echo may come at any time, and moves the stamps from then on: within what was said before, and its drift.
    assert np.allclose(frames.t_s, began_s + np.arange(24) / 240.0, rtol=0.0, atol=uncertainty_s + 1e-4)
    assert np.isclose(np.diff(frames.t_s), 1 / 240.0, rtol=0.0, atol=1e-5).sum() >= 20
    assert frames.frame.tolist() == list(range(1, 25))
    assert (bench.identity.adapter, bench.identity.rate_hz, bench.identity.simulated) == ("natnet", 240.0, False)


def test_fewer_frames_are_every_so_manyth_and_the_rate_says_so(stack: ExitStack) -> None:
    bench = Bench(stack, rate_hz=100.0)
    assert bench.identity.rate_hz == 80.0
    bench.send(range(1, 13))
    assert bench.frames(4).frame.tolist() == [3, 6, 9, 12]


def test_a_body_that_is_not_tracked_has_no_pose(stack: ExitStack) -> None:
    bench = Bench(stack)
    bench.send(range(1, 4), flags=0)
    frames = bench.frames(3)
    assert not frames.tracked.any()
    assert np.isnan(frames.x_m).all()


def test_a_body_may_be_named_by_its_id(stack: ExitStack) -> None:
    bench = Bench(stack, body=3.0)
    bench.send(range(1, 3))
    assert np.allclose(bench.frames(2).x_m, POSES[2, 0])


def test_a_body_that_nobody_knows_is_said(stack: ExitStack) -> None:
    bench = Bench(stack, body="agv9")
    deadline = time.monotonic() + 10.0
    for number in itertools.takewhile(lambda _: time.monotonic() < deadline, itertools.count(1)):
        bench.send(range(number, number + 1))
        time.sleep(0.05)
        if (event := _next_event(bench)) is not None:
            assert "no rigid body is called 'agv9' (there are: agv1 agv2 agv3)" in event.text
            return
    pytest.fail("nothing was said")


def _next_event(bench: Bench) -> Event | None:
    bench.inbox.wake()
    report = bench.inbox.receive()
    return report if isinstance(report, Event) else None


@pytest.mark.parametrize(
    ("address", "camera", "said"),
    [
        ("", {}, "NatNet server has no address; write natnet:HOST"),
        ("h:99999", {}, "natnet:h:99999: port is out of range: 99999"),
        ("h:http", {}, "port is out of range: http"),
        ("h", {"lost": 0.1}, "not an option of a NatNet camera: lost"),
        ("h", {"up": "x"}, r"unknown vertical axis: x \(limit: y or z"),
        ("h", {"rate_hz": 0.0}, "frame rate is out of range: 0.0"),
        ("h", {"rate_hz": "fast"}, "frame rate is out of range: fast"),
        ("h", {"data_port": math.nan}, "port is out of range: nan"),
    ],
)
def test_bad_options_are_one_clear_line(address: str, camera: dict[str, Any], said: str) -> None:
    with pytest.raises(FlagError, match=said):
        NatNetOptions.parse(address, camera, "agv1")
