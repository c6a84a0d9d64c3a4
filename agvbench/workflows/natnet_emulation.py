"""``agvbench mocap --emulate``: a NatNet server that sees a simulated vehicle drive in circles, in real time."""

from __future__ import annotations

import numpy as np

from agvbench.adapters.contract import AdapterOptions
from agvbench.adapters.natnet.axes import bodies_of
from agvbench.adapters.natnet.channel import DATA_PORT
from agvbench.adapters.natnet.emulator import Emulator, Settings
from agvbench.adapters.natnet.network_faults import PacketFaults
from agvbench.adapters.natnet.options import multicast_group
from agvbench.adapters.natnet.protocol.bitstream import MARKER, Version
from agvbench.adapters.natnet.protocol.encode import Model
from agvbench.adapters.natnet.protocol.frame import FrameOfData
from agvbench.bus.clock import WallClock, wait_until
from agvbench.simulator import Camera, load_plant
from agvbench.types import Command, Frames
from agvbench.workflows.adapter_process import say_stopped, stop_signal

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
    plant = load_plant(options.plant)(options.seed)
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
