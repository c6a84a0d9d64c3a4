"""``agvbench sim``, ``agv`` and ``mocap``: adapters as their own process, until a signal ends it."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress

import numpy as np

from agvbench.adapters.contract import AdapterOptions
from agvbench.adapters.frame_recorder import FrameRecorder, summarise
from agvbench.adapters.natnet.axes import bodies_of
from agvbench.adapters.natnet.channel import DATA_PORT
from agvbench.adapters.natnet.emulator import Emulator, Settings
from agvbench.adapters.natnet.network_faults import PacketFaults
from agvbench.adapters.natnet.options import multicast_group
from agvbench.adapters.natnet.protocol.bitstream import MARKER, Version
from agvbench.adapters.natnet.protocol.encode import Model
from agvbench.adapters.natnet.protocol.frame import FrameOfData
from agvbench.adapters.node import host_adapters
from agvbench.bus.bus_config import BusConfig
from agvbench.bus.clock import Clock, WallClock, wait_until
from agvbench.bus.session import bus_session, is_open_to_all
from agvbench.simulator import Camera, load_plant
from agvbench.types import Command, Frames

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_POLL_S = 0.1


def run_adapters(
    options: AdapterOptions,
    *,
    agv: str | None,
    mocap: str | None,
    lab: str,
    listen: Sequence[str],
    connect: Sequence[str],
    bus_config: str | None = None,
    status_s: float | None = None,
) -> int:
    """Host adapters until SIGINT, SIGTERM or SIGHUP; stop the vehicle first, then leave the bus.

    Every `status_s` [s] a line says what arrives from the camera; None: no line.

    Raises
    ------
    AgvbenchError
        If an endpoint, a name, an adapter or its plant, or the bus's configuration cannot be used.
    """
    config = BusConfig.load(bus_config) if bus_config else None
    _warn_of_remote_access(listen, config)
    recorder = None if status_s is None else FrameRecorder(options.clock)
    with (
        stop_signal() as stopped,
        bus_session(listen=listen, connect=connect, allow_remote=True, config=config) as session,
        host_adapters(session, lab, options, agv=agv, mocap=mocap, recorder=recorder),
    ):
        what = " and ".join(f"{role} {spec}" for role, spec in (("agv", agv), ("mocap", mocap)) if spec is not None)
        where = " ".join([*(f"listens on {e}" for e in listen), *(f"connected to {e}" for e in connect)])
        print(f"ready: {what} of {lab}/{options.vehicle}, {where}; stop with Ctrl-C", flush=True)
        status = None if recorder is None or status_s is None else StreamStatus(recorder, options.clock, status_s)
        while not stopped:
            time.sleep(_POLL_S)
            if status is not None:
                status.print_if_due()
    say_stopped()
    return 0


class StreamStatus:
    """Prints what arrives from a camera every `period_s` [s]: on a terminal over the line before."""

    def __init__(self, recorder: FrameRecorder, clock: Clock, period_s: float) -> None:
        self._recorder, self._clock, self._period_s = recorder, clock, period_s
        self._printed_s = self._frame_s = clock.now()

    def print_if_due(self) -> None:
        """Print a line if the last one is old enough; an error of the adapter stands on a line of its own."""
        now_s = self._clock.now()
        passed_s = now_s - self._printed_s
        if passed_s < self._period_s:
            return
        frames = Frames.concatenate([batch.frames for batch in self._recorder.take()])
        if error := self._recorder.take_error():
            self._print(f"failed: {error}", replaced=False)
        if len(frames):
            self._frame_s = now_s
            self._print(str(summarise(frames, passed_s)), replaced=True)
        else:
            self._print(f"no frame for {now_s - self._frame_s:.0f} s", replaced=True)
        self._printed_s = now_s

    @staticmethod
    def _print(text: str, *, replaced: bool) -> None:
        to_terminal = sys.stdout.isatty()
        start = "\r\x1b[K" if to_terminal else ""
        with suppress(OSError):
            print(f"{start}{text}", end="" if to_terminal and replaced else "\n", flush=True)


def _warn_of_remote_access(listen: Sequence[str], config: BusConfig | None) -> None:
    for endpoint in listen:
        if is_open_to_all(endpoint, config, "--listen"):
            print(
                f"warning: every peer that reaches {endpoint} can drive the vehicle; no certificate is required",
                file=sys.stderr,
            )


def say_stopped() -> None:
    """Say that everything is stopped, unless the terminal itself was closed."""
    with suppress(OSError):
        print("\r\x1b[Kstopped" if sys.stdout.isatty() else "stopped", flush=True)


@contextmanager
def stop_signal() -> Iterator[list[int]]:
    """Give the list that SIGINT, SIGTERM and SIGHUP are added to, in place of what they do.

    Under ``nohup`` SIGHUP stays ignored. The list is to be looked at again and again: the kernel may deliver a signal
    to another thread, which does not wake one that waits in the main thread, and a handler that took a lock could wait
    for the code that it interrupted.
    """
    stopped: list[int] = []
    hung_up = signal.getsignal(signal.SIGHUP)
    taken = [number for number in _SIGNALS if number != signal.SIGHUP or hung_up is not signal.SIG_IGN]
    before = {number: signal.signal(number, lambda caught, _: stopped.append(caught)) for number in taken}
    try:
        yield stopped
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


_BODY = 1
_CIRCLE = Command(1700.0, 1450.0, 1550.0)
_NO_MARKERS = np.zeros(0, MARKER)


def emulate(options: AdapterOptions, version: str, multicast: str | None, port: int) -> int:
    """Stream until SIGINT, SIGTERM or SIGHUP.

    Raises
    ------
    AgvbenchError
        If version, port, plant or camera cannot be used.
    """
    group = None if multicast is None else multicast_group(multicast, "--multicast")
    faults, seen_with = PacketFaults.split(options.camera)
    camera = Camera.from_options(seen_with)
    settings = Settings(
        Version.parse(version), port=port, multicast=group, data_port=DATA_PORT if group else 0,
        rate_hz=camera.rate_hz, network=faults, seed=options.seed,
    )  # fmt: skip
    server = Emulator(settings, [Model(_BODY, options.vehicle)])
    try:
        with stop_signal() as stopped:
            host, own_port = server.address
            where = f"to {group}" if group else "in unicast"
            print(f"ready: NatNet {version} at {host}:{own_port}, streaming {where}; stop with Ctrl-C", flush=True)
            _stream(server, camera, options, stopped)
    finally:
        server.close()
    say_stopped()
    return 0


def _stream(server: Emulator, camera: Camera, options: AdapterOptions, stopped: list[int]) -> None:
    plant = load_plant(options.plant, options.plant_options)(options.seed)
    plant.reset((0.0, 0.0, 0.0), seed=options.seed)
    tracker = camera.tracker(np.random.default_rng(options.seed))
    clock, period_s, number = WallClock(), 1.0 / camera.rate_hz, 0
    began_s = clock.now()
    while not stopped:
        number += 1
        pose = plant.advance(*_CIRCLE, period_s)
        at_s = began_s + number * period_s
        wait_until(clock, at_s)
        for frame in _frames(tracker.observe(np.array([at_s]), np.array([pose])), server):
            server.send(frame)


def _frames(seen: Frames, server: Emulator) -> list[FrameOfData]:
    """Return what the camera makes of a pose: one frame, none or two."""
    bodies, now = bodies_of(seen, _BODY), server.ticks()
    return [
        FrameOfData(
            int(seen.frame[row]) + 1,
            bodies[row : row + 1],
            _NO_MARKERS,
            float(at_s),
            server.ticks(float(at_s)),
            now,
            now,
            0,
        )
        for row, at_s in enumerate(seen.t_s)
    ]
