"""A frame recorder: takes what a mocap adapter reports, and says how many frames arrive and what they contain."""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agvbench.adapters.contract import MocapReports
from agvbench.bus.clock import Clock
from agvbench.bus.messages.event import Level
from agvbench.bus.messages.frames import FrameClock
from agvbench.types import Frames

_BATCHES_KEPT = 100_000


class Batch(NamedTuple):
    """Frames of one report, the clock of their capture times, and when they were reported [s] in the host's clock."""

    frames: Frames
    clock: FrameClock
    reported_s: float


class FrameRecorder:
    """Receives frames, events and errors in any thread, and keeps the newest until they are taken.

    Parameters
    ----------
    clock
        The host's.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._forward: MocapReports | None = None
        self._batches: deque[Batch] = deque(maxlen=_BATCHES_KEPT)
        self.error: Exception | None = None
        self.arrived = threading.Event()

    def before(self, reports: MocapReports) -> FrameRecorder:
        """Pass every report on to `reports` from now on; return this recorder, to be given to an adapter."""
        self._forward = reports
        return self

    def frames(self, frames: Frames, *, clock: FrameClock, acknowledged: int = 0) -> None:
        """Keep frames."""
        self._keep(Batch(frames, clock, self._clock.now()))
        if self._forward is not None:
            self._forward.frames(frames, clock=clock, acknowledged=acknowledged)

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
        """Keep one frame."""
        # float() refuses None and texts in the adapter's thread, as packing them for the bus does.
        columns = (float(t_s), float(x_m), float(y_m), float(heading_rad), bool(tracked), int(frame))
        rest = (float(mean_error_m), float(received_s))
        self._keep(Batch(Frames(*(np.array([value]) for value in (*columns, *rest))), clock, self._clock.now()))
        if self._forward is not None:
            self._forward.frame(
                t_s, x_m, y_m, heading_rad, clock=clock, tracked=tracked, frame=frame, mean_error_m=mean_error_m,
                received_s=received_s, acknowledged=acknowledged,
            )  # fmt: skip

    def _keep(self, batch: Batch) -> None:
        self._batches.append(batch)
        if len(batch.frames):
            self.arrived.set()

    def event(self, level: Level, kind: str, text: str, *, acknowledged: int = 0) -> None:
        """Pass an event on."""
        if self._forward is not None:
            self._forward.event(level, kind, text, acknowledged=acknowledged)

    def failed(self, error: Exception, *, acknowledged: int = 0) -> None:
        """Keep the first error until it is taken."""
        self.error = self.error or error
        if self._forward is not None:
            self._forward.failed(error, acknowledged=acknowledged)

    def take(self) -> list[Batch]:
        """Return the batches since the last call, oldest first; safe beside a thread that adds some."""
        return [self._batches.popleft() for _ in range(len(self._batches))]

    def take_error(self) -> Exception | None:
        """Return the first error since the last call, or None."""
        error, self.error = self.error, None
        return error


@dataclass(frozen=True)
class StreamSummary:
    """What arrived of a stream: frames per second, the share [0 to 1] that contains the vehicle, the last such pose.

    ``pose`` is x [m], y [m] and heading [rad]; None where no frame contained the vehicle.
    """

    count: int
    rate_hz: float
    tracked_share: float
    pose: tuple[float, float, float] | None

    def __str__(self) -> str:
        """Return one line without a full stop."""
        if not self.count:
            return "no frame"
        said = f"{self.rate_hz:.1f} frames/s, {100.0 * self.tracked_share:.0f} % tracked"
        if self.pose is None:
            return said
        x_m, y_m, heading_rad = self.pose
        return f"{said}, last pose x = {x_m:z.3f} m, y = {y_m:z.3f} m, heading {math.degrees(heading_rad):z.1f}°"


def summarise(frames: Frames, duration_s: float) -> StreamSummary:
    """Return a summary of `frames`, which arrived within `duration_s` [s].

    >>> columns = (np.zeros(2), np.ones(2), np.zeros(2), np.zeros(2), np.array([True, False]))
    >>> print(summarise(Frames(*columns, np.arange(2), np.zeros(2), np.zeros(2)), 0.5))
    4.0 frames/s, 50 % tracked, last pose x = 1.000 m, y = 0.000 m, heading 0.0°
    """
    count = len(frames)
    if not count:
        return StreamSummary(0, 0.0, 0.0, None)
    tracked = np.flatnonzero(frames.tracked)
    pose = None
    if len(tracked):
        last = int(tracked[-1])
        pose = (float(frames.x_m[last]), float(frames.y_m[last]), float(frames.heading_rad[last]))
    return StreamSummary(count, count / duration_s, len(tracked) / count, pose)


def listen(recorder: FrameRecorder, clock: Clock, watched_s: float, first_limit_s: float) -> StreamSummary:
    """Wait for the first frame for `first_limit_s` [s], then record for `watched_s` [s]; return the summary.

    The batches are taken. An error that the adapter reports ends the wait, and stays in the recorder.
    """
    if not _first_frame(recorder, clock, first_limit_s):
        return StreamSummary(0, 0.0, 0.0, None)
    recorder.take()
    began_s = clock.now()
    clock.sleep(watched_s)
    frames = Frames.concatenate([batch.frames for batch in recorder.take()])
    return summarise(frames, clock.now() - began_s)


def _first_frame(recorder: FrameRecorder, clock: Clock, limit_s: float) -> bool:
    deadline_s = clock.now() + limit_s
    while recorder.error is None and clock.now() < deadline_s:
        if clock.wait(recorder.arrived, 0.05):
            return True
    return False
