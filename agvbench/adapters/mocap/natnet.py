"""``natnet:HOST``: OptiTrack's Motive, or what speaks as it does."""

from __future__ import annotations

import math

from agvbench.adapters.contract import AdapterOptions, MocapAdapter, MocapReports
from agvbench.adapters.natnet.axes import to_floor
from agvbench.adapters.natnet.client import Client, Seen
from agvbench.adapters.natnet.emulated_camera import EMULATED, EmulatedNatNet
from agvbench.adapters.natnet.options import NatNetOptions
from agvbench.adapters.natnet.protocol.bitstream import TRACKED
from agvbench.bus.messages.event import Level
from agvbench.bus.messages.frames import FrameClock
from agvbench.bus.messages.identity import MocapIdentity
from agvbench.errors import LinkError

_QUIET_S = 1.0
# Sooner than the supervisor, which would only say that tracking was lost.
_PATIENCE_S = 0.4


class NatNetMocap(MocapAdapter):
    """One rigid body of a NatNet stream; a pose carries the time of its exposure, in the host's clock.

    Frames in which the body is missing or not tracked are published without a pose. Where fewer frames are wanted than
    the camera takes, every second, third, … is published, by the camera's own numbers.
    """

    scheme = "natnet"

    def __init__(self, options: NatNetOptions, adapter: AdapterOptions) -> None:
        self._options, self._clock = options, adapter.clock
        self._reported_s, self._reported = -math.inf, (0, 0, 0)
        self._client = Client(options.connection, adapter.clock, self._see, self._report_problems)
        self._every, self._rate_hz = self._decimation(self._client.rate_hz)
        self._body: int | None = None
        self._began_s = adapter.clock.now()

    def _decimation(self, camera_hz: float) -> tuple[int, float]:
        """Return how many frames are one published, and the rate [Hz] that makes."""
        wanted_hz = self._options.rate_hz
        if camera_hz > 0.0:
            every = max(1, math.ceil(camera_hz / (wanted_hz or camera_hz) - 1e-6))
            return every, camera_hz / every
        if wanted_hz is None:
            self._client.close()
            raise LinkError(
                "server does not say its frame rate", where=self._options.connection, remedy="add --camera rate_hz=120"
            )
        return 1, wanted_hz

    @classmethod
    def open(cls, address: str, options: AdapterOptions) -> MocapAdapter:  # type: ignore[override]
        """Connect to the server at `address`; ``emulated`` brings its own."""
        if address == EMULATED:
            return EmulatedNatNet.open("", options)
        return cls(NatNetOptions.parse(address, options.camera, options.vehicle), options)

    @classmethod
    def check(cls, address: str, options: AdapterOptions) -> None:
        """Refuse an address or an option that cannot be."""
        if address == EMULATED:
            EmulatedNatNet.check("", options)
        else:
            NatNetOptions.parse(address, options.camera, options.vehicle)

    def identity(self) -> MocapIdentity:
        """Return the server's identity, with its versions."""
        info = self._client.info
        extra = {
            "server": f"{info.application} {info.application_version}", "natnet": str(self._client.version),
            "body": self._options.body, "up": self._options.up, "camera_hz": f"{self._client.rate_hz:g}",
        }  # fmt: skip
        return MocapIdentity(self.scheme, self._rate_hz, simulated=False, extra=extra)

    def start(self, reports: MocapReports) -> None:
        """Publish every frame from now on."""
        self._reports = reports
        self._client.start()

    def _see(self, seen: Seen) -> None:
        number = seen.frame.number
        if number % self._every:
            return
        body = self._which(seen.received_s)
        if body is None:
            return
        (found,) = (seen.frame.bodies["id"] == body).nonzero()
        x_m = y_m = heading_rad = error_m = math.nan
        tracked = bool(len(found)) and bool(seen.frame.bodies["flags"][found[0]] & TRACKED)
        if tracked:
            one = seen.frame.bodies[found[:1]]
            x_m, y_m, heading_rad = to_floor(one["position_m"], one["quaternion"], self._options.up)[0].tolist()
            error_m, tracked = float(one["mean_error_m"][0]), math.isfinite(x_m + y_m + heading_rad)
        self._reports.frame(
            seen.captured.time_s, x_m, y_m, heading_rad, clock=FrameClock.ADAPTER, tracked=tracked, frame=number,
            mean_error_m=error_m, received_s=seen.received_s,
        )  # fmt: skip

    def _which(self, now_s: float) -> int | None:
        """Return the id of the vehicle's body; None as long as nothing says which it is."""
        name, names = self._options.body, self._client.names
        if name in names:
            return names[name]
        if name.isascii() and name.isdigit():
            return int(name)
        if now_s - self._began_s > _PATIENCE_S and now_s - self._reported_s > _QUIET_S:
            self._reported_s = now_s
            known = " ".join(sorted(names)) or "none"
            error = LinkError(
                f"no rigid body is called {name!r} (there are: {known})",
                remedy="rename it in Motive, or say --camera body=NAME",
            )
            self._reports.failed(error)
        return None

    def _report_problems(self, now_s: float) -> None:
        counters = self._client.counters
        now = (counters.lost, counters.malformed, counters.foreign)
        if now != self._reported and now_s - self._reported_s > _QUIET_S:
            lost, malformed, foreign = (new - old for new, old in zip(now, self._reported, strict=True))
            self._reported, self._reported_s = now, now_s
            text = f"{lost} camera frames were lost"
            if malformed:
                text += f", {malformed} packets could not be decoded: {counters.first_malformed}"
            if foreign:
                text += f", {foreign} packets were not the server's"
                if (port := counters.foreign_port) is not None:
                    text += f" (frames from port {port}: if that is the server's, add --camera data_port={port})"
            self._reports.event(Level.WARNING, "frames_lost", text)

    def close(self) -> None:
        """Leave the server."""
        self._client.close()
