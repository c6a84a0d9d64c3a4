"""``impaired:FAULTS:ADAPTER``: another camera, and what goes wrong with it: to rehearse faults, never by itself."""

from __future__ import annotations

import math

import numpy as np
from msgspec.structs import replace

from agvbench.adapters.contract import AdapterOptions, MocapAdapter, MocapReports
from agvbench.adapters.impairment.faults import Faults, frame_fault
from agvbench.adapters.impairment.spec import SCHEME, Impairment, parse_address
from agvbench.adapters.registry import check_mocap, open_mocap
from agvbench.bus.messages.event import Level
from agvbench.bus.messages.frames import FrameClock
from agvbench.bus.messages.identity import MocapIdentity
from agvbench.bus.messages.request import Reset, Sampling
from agvbench.bus.messages.truth import Truth
from agvbench.types import Frames


class ImpairedMocap(MocapAdapter):
    """A camera with faults, which are injected into its frames by their capture times.

    A simulated camera's times are those of its run; a real one's count from its first frame, and are all one run.
    """

    scheme = SCHEME

    def __init__(self, camera: MocapAdapter, impairments: list[Impairment], options: AdapterOptions) -> None:
        self._camera, self._origin_s = camera, math.nan
        self._faults = Faults(impairments, frame_fault, seed=options.seed)

    @classmethod
    def open(cls, address: str, options: AdapterOptions) -> ImpairedMocap:
        """Open the camera behind the faults."""
        impairments, spec = cls._parsed(address)
        return cls(open_mocap(spec, options), impairments, options)

    @classmethod
    def check(cls, address: str, options: AdapterOptions) -> None:
        """Check the faults, and the camera behind them."""
        check_mocap(cls._parsed(address)[1], options)

    @staticmethod
    def _parsed(address: str) -> tuple[list[Impairment], str]:
        impairments, spec = parse_address(address)
        for impairment in impairments:
            frame_fault(impairment)
        return impairments, spec

    def identity(self) -> MocapIdentity:
        """Return the camera's identity, marked as impaired."""
        identity = self._camera.identity()
        return replace(identity, extra={**identity.extra, "impaired": self._faults.names})

    def start(self, reports: MocapReports) -> None:
        """Stand between the camera and `reports`."""
        self._reports = reports
        self._camera.start(self)

    def reset(self, request: Reset) -> Sampling:
        """Begin a run."""
        self._faults.begin(request.run_key)
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

    def frames(self, frames: Frames, *, clock: FrameClock, acknowledged: int = 0) -> None:
        """Publish what the faults leave of the camera's frames."""
        for when, fault in self._faults:
            struck = self._injected(when, frames, clock)
            if struck.any():
                frames = Frames.concatenate([frames.select(~struck), fault.change(frames.select(struck))])
        self._reports.frames(frames, clock=clock, acknowledged=acknowledged)

    def _injected(self, when: Impairment, frames: Frames, clock: FrameClock) -> np.ndarray:
        if clock is FrameClock.RUN:
            return np.array([when.holds(self._faults.run, t_s) for t_s in frames.t_s.tolist()], np.bool_)
        if math.isnan(self._origin_s) and len(frames):
            self._origin_s = float(frames.t_s[0])
        return np.array([when.holds(self._faults.run, t_s - self._origin_s) for t_s in frames.t_s.tolist()], np.bool_)

    def frame(
        self,
        t_s: float,
        x_m: float,
        y_m: float,
        heading_rad: float,
        *,
        clock: FrameClock,
        tracked: bool = True,
        frame: int = -1,
        mean_error_m: float = math.nan,
        received_s: float = math.nan,
        acknowledged: int = 0,
    ) -> None:
        """Publish what the faults leave of one frame."""
        columns = (t_s, x_m, y_m, heading_rad, tracked, frame, mean_error_m, received_s)
        self.frames(Frames(*(np.array([value]) for value in columns)), clock=clock, acknowledged=acknowledged)

    def close(self) -> None:
        """Close the camera."""
        self._camera.close()
