"""``sim``: a simulated camera. It is shown true poses, and publishes what a motion capture system makes of them."""

from __future__ import annotations

import numpy as np

from agvbench.adapters.contract import AdapterOptions, MocapAdapter, MocapReports, run_seed
from agvbench.bus.messages.frames import FrameClock
from agvbench.bus.messages.identity import MocapIdentity
from agvbench.bus.messages.request import Reset, Sampling
from agvbench.bus.messages.truth import Truth, TruthFlags
from agvbench.errors import LinkError
from agvbench.simulator import Camera, Tracker
from agvbench.types import Frames


class SimMocap(MocapAdapter):
    """A camera that is not synchronised with the runs: each begins at a random phase between two frames."""

    scheme = "sim"

    def __init__(self, camera: Camera, options: AdapterOptions) -> None:
        self._camera, self._options = camera, options
        self._tracker: Tracker | None = None
        self._parts: list[Truth] = []
        self._under_way = Frames.empty()

    @classmethod
    def open(cls, address: str, options: AdapterOptions) -> SimMocap:
        """Make the camera that the options describe, ready to look: the first frame waits for nothing."""
        camera = cls._described(address, options)
        camera.observe(np.zeros(1), np.zeros((1, 3)), np.random.default_rng(0))
        return cls(camera, options)

    @classmethod
    def check(cls, address: str, options: AdapterOptions) -> None:
        """Refuse an address, and what no camera can be."""
        cls._described(address, options)

    @staticmethod
    def _described(address: str, options: AdapterOptions) -> Camera:
        if address:
            raise LinkError("a simulated camera has no address", where=f"sim:{address}", remedy="write sim")
        return Camera.from_options(options.camera)

    def identity(self) -> MocapIdentity:
        """Return the simulated camera's identity."""
        extra = {"seed": str(self._options.seed), "camera": str(self._camera)}
        return MocapIdentity(self.scheme, self._camera.rate_hz, simulated=True, extra=extra)

    def start(self, reports: MocapReports) -> None:
        """Keep what publishes frames."""
        self._reports = reports

    def reset(self, request: Reset) -> Sampling:
        """Begin a run."""
        rng = np.random.default_rng(run_seed(self._options.seed, request.run_key, "camera", bits=128))
        self._tracker = self._camera.tracker(rng)
        self._parts, self._under_way = [], Frames.empty()
        return Sampling(self._camera.rate_hz, rng.random() / self._camera.rate_hz)

    def see(self, truth: Truth) -> None:
        """Publish the frames that have arrived by the end of the interval."""
        if self._tracker is None:
            raise LinkError("camera was not reset before its first frame", where=self.scheme, remedy="reset the run")
        self._parts.append(truth)
        if not truth.flags & TruthFlags.LAST:
            return
        parts, self._parts = self._parts, []
        frames = self._tracker.observe(
            np.concatenate([part.t_s for part in parts]), np.concatenate([part.poses for part in parts])
        )
        until_s = np.inf if truth.flags & TruthFlags.FLUSH else truth.end_s
        clock = FrameClock.ADAPTER if truth.flags & TruthFlags.LIVE else FrameClock.RUN
        self._reports.frames(self._arrived(frames, until_s), clock=clock, acknowledged=truth.acknowledged)

    def _arrived(self, frames: Frames, until_s: float) -> Frames:
        """Return what is received before `until_s`, in order; the rest stays under way."""
        if len(self._under_way):
            frames = Frames.concatenate([self._under_way, frames])
            frames = frames.select(np.argsort(frames.received_s, kind="stable"))
        count = int(np.searchsorted(frames.received_s, until_s, side="left"))
        if count == len(frames):
            self._under_way = Frames.empty()
            return frames
        self._under_way = frames.select(np.arange(count, len(frames)))
        return frames.select(np.arange(count))

    def close(self) -> None:
        """Nothing to release."""
