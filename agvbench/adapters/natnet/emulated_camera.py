"""``natnet:emulated``: a simulated camera whose frames travel as NatNet packets over UDP, in lock step.

What the simulated camera sees is encoded as Motive encodes it, sent through a socket, and decoded by the client that
listens to real servers. Both ends take the time from one simulated clock, which shows a frame's arrival when the frame
is sent; so keep-alives, echoes and time stamps are exercised, and the same seed gives the same bytes.
"""

from __future__ import annotations

import math
import threading
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agvbench.adapters.contract import AdapterOptions, MocapAdapter, MocapReports
from agvbench.adapters.natnet.axes import bodies_of, to_floor
from agvbench.adapters.natnet.channel import Connection
from agvbench.adapters.natnet.client import Client, Seen
from agvbench.adapters.natnet.emulator import Emulator, Settings
from agvbench.adapters.natnet.network_faults import PacketFaults
from agvbench.adapters.natnet.protocol.bitstream import BODY, MARKER, TRACKED, Version
from agvbench.adapters.natnet.protocol.encode import Model
from agvbench.adapters.natnet.protocol.frame import FrameOfData
from agvbench.adapters.registry import check_mocap, open_mocap
from agvbench.bus.clock import SimulatedClock, WallClock
from agvbench.bus.messages.event import Level
from agvbench.bus.messages.frames import FrameClock
from agvbench.bus.messages.identity import MocapIdentity
from agvbench.bus.messages.request import Reset, Sampling
from agvbench.bus.messages.truth import Truth
from agvbench.errors import LinkError
from agvbench.types import Frames

EMULATED = "emulated"
_BODY = 1
_BETWEEN_RUNS_S = 10.0
_PATIENCE_S = 5.0
_NO_MARKERS = np.zeros(0, MARKER)


class EmulatedNatNet(MocapAdapter):
    """A simulated camera behind the real protocol."""

    scheme = "natnet:emulated"

    def __init__(self, options: AdapterOptions) -> None:
        faults, version, simulated = self._split(options)
        self._camera = open_mocap("sim", simulated)
        self._rate_hz = self._camera.identity().rate_hz
        self._clock, self._base_s, self._last_s = SimulatedClock(), 0.0, 0.0
        self._seen: list[Seen] = []
        self._number = self._offset = 0
        settings = Settings(version, rate_hz=self._rate_hz, network=faults, seed=options.seed)
        self._server = Emulator(settings, [Model(_BODY, options.vehicle)], self._clock, threaded=False)
        self._client = self._connected(options.vehicle)

    def _connected(self, vehicle: str) -> Client:
        """Return a client after its handshake; the server answers in a thread for as long as that takes."""
        done = threading.Event()

        def serve() -> None:
            while not done.is_set():
                self._server.step(0.01)

        thread = threading.Thread(target=serve, name="natnet-handshake", daemon=True)
        thread.start()
        try:
            host, port = self._server.address
            client = Client(Connection(host, port, host), self._clock, self._seen.append)
        except BaseException:
            self._server.close()
            raise
        finally:
            done.set()
            thread.join()
        while not client.ready:
            client.step(0.0)
            self._server.step(0.01)
        return client

    @classmethod
    def open(cls, address: str, options: AdapterOptions) -> EmulatedNatNet:
        """Make camera, server and client."""
        return cls(options)

    @classmethod
    def check(cls, address: str, options: AdapterOptions) -> None:
        """Refuse an option that neither the network, the stream nor the camera has."""
        check_mocap("sim", cls._split(options)[2])

    @staticmethod
    def _split(options: AdapterOptions) -> tuple[PacketFaults, Version, AdapterOptions]:
        """Return the network's faults, the version of the stream, and what is left for the camera."""
        faults, camera = PacketFaults.split(options.camera)
        camera.pop("version", None)
        return faults, Version.parse(str(options.camera.get("version", "4.1"))), replace(options, camera=camera)

    def identity(self) -> MocapIdentity:
        """Return the emulated camera's identity, with the version of its bit stream."""
        extra = {**self._camera.identity().extra, "natnet": str(self._client.version)}
        return MocapIdentity(self.scheme, self._rate_hz, simulated=True, extra=extra)

    def start(self, reports: MocapReports) -> None:
        """Keep what publishes frames; the camera's own go through the network first."""
        self._reports = reports
        self._camera.start(self)

    def reset(self, request: Reset) -> Sampling:
        """Begin a run."""
        self._base_s = self._last_s + _BETWEEN_RUNS_S
        self._offset = self._number + 1  # the camera counts from 0 in every run, a server does not
        return self._camera.reset(request)

    def see(self, truth: Truth) -> None:
        """Let the camera look."""
        self._camera.see(truth)

    def event(self, level: Level, kind: str, text: str, *, acknowledged: int = 0) -> None:
        """Pass on what the camera says."""
        self._reports.event(level, kind, text, acknowledged=acknowledged)

    def failed(self, error: Exception, *, acknowledged: int = 0) -> None:
        """Pass on what the camera failed with."""
        self._reports.failed(error, acknowledged=acknowledged)

    def frame(self, *_: object, **__: object) -> None:
        """Refuse: simulated cameras publish batches."""
        raise NotImplementedError

    def frames(self, frames: Frames, *, clock: FrameClock, acknowledged: int = 0) -> None:
        """Publish what arrives of the camera's frames at the other end of the network."""
        self._seen.clear()
        arrived_s = np.maximum.accumulate(np.append(self._last_s, frames.received_s + self._base_s))[1:]
        bodies = bodies_of(frames, _BODY)
        for index in range(len(frames)):
            self._transmit(frames, index, bodies[index : index + 1], float(arrived_s[index]))
        self._reports.frames(self._published(), clock=clock, acknowledged=acknowledged)

    def _transmit(self, frames: Frames, index: int, body: NDArray[Any], now_s: float) -> None:
        self._clock.sleep(now_s - self._clock.now())
        self._last_s = now_s
        self._client.step(0.0)
        # A busy kernel may take its time even on loopback; what was said at this instant is answered at this instant.
        while self._server.heard < self._client.packets_sent and self._server.step(_PATIENCE_S):
            pass
        handled = self._handled()
        sent = self._server.send(self._as_sent(frames, index, body))
        deadline_s = WallClock.now() + _PATIENCE_S
        while self._handled() < handled + sent:
            is_late = WallClock.now() > deadline_s  # on a machine that stood still, what has come is taken first
            self._client.step(_PATIENCE_S / 10.0)
            if is_late and self._handled() < handled + sent:
                raise LinkError("a NatNet packet was lost on loopback", where=self.scheme)

    def _handled(self) -> int:
        counters = self._client.counters
        return counters.frames + counters.repeated + counters.malformed

    def _as_sent(self, frames: Frames, index: int, body: NDArray[Any]) -> FrameOfData:
        exposed_s = float(frames.t_s[index]) + self._base_s
        sent = self._server.ticks(exposed_s), self._server.ticks(), self._server.ticks()
        number = int(frames.frame[index]) + self._offset
        self._number = max(self._number, number)
        return FrameOfData(number, body, _NO_MARKERS, exposed_s, *sent, 0)

    def _published(self) -> Frames:
        bodies = np.concatenate([np.zeros(0, BODY), *(one.frame.bodies for one in self._seen)])
        tracked = (bodies["flags"] & TRACKED).astype(np.bool_)
        poses = to_floor(bodies["position_m"], bodies["quaternion"], "y")
        poses[~tracked] = math.nan
        times = np.array([(one.captured.time_s, one.received_s, one.frame.number) for one in self._seen]).reshape(-1, 3)
        x_m, y_m, heading_rad = poses.T.copy()
        return Frames(
            times[:, 0] - self._base_s, x_m, y_m, heading_rad, tracked, times[:, 2].astype(np.int64) - self._offset,
            bodies["mean_error_m"].astype(np.float64), times[:, 1] - self._base_s,
        )  # fmt: skip

    def close(self) -> None:
        """Leave the network."""
        self._client.close()
        self._server.close()
        self._camera.close()
