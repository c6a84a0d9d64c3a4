"""Checks of the frames that a mocap adapter publishes: their number, poses, times, frame numbers and rate."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from agvbench.adapters.contract import MocapAdapter
from agvbench.adapters.contract_checks.result import CheckFailedError, call
from agvbench.adapters.frame_recorder import Batch, FrameRecorder, summarise
from agvbench.bus.clock import Clock
from agvbench.bus.messages.frames import FrameClock
from agvbench.bus.messages.identity import MocapIdentity
from agvbench.bus.messages.request import Reset, Sampling
from agvbench.bus.messages.truth import Truth, TruthFlags
from agvbench.types import Floats, Frames, Pose

FIRST_FRAME_LIMIT_S = 3.0
_SHARE_IN_ORDER = 0.95
_FURTHEST_M = 50.0
"""No capture volume of model vehicles is as large: larger positions are millimetres."""
_TRUE_WITHIN_M = 0.1
_OLDEST_S, _NEWEST_S = 1.0, 0.01
_RATE_RATIOS = (0.8, 1.25)
_START, _SPEED_MPS = Pose(0.5, -0.25, 0.75), 0.2
_KEY = "contract-check"


@dataclass(frozen=True)
class Stream:
    """What a camera published in `watched_s` [s]; ``true_poses`` (n, 3) at ``true_s`` (n,) if it is simulated."""

    identity: MocapIdentity
    batches: list[Batch]
    watched_s: float
    error: Exception | None
    true_s: Floats
    true_poses: Floats

    @property
    def frames(self) -> Frames:
        """All frames, in the order of their arrival."""
        return Frames.concatenate([batch.frames for batch in self.batches])


def record_stream(camera: MocapAdapter, recorder: FrameRecorder, clock: Clock, watched_s: float) -> Stream:
    """Return what a camera that was started publishes; a simulated one is shown a vehicle that drives."""
    identity = camera.identity()
    if identity.simulated:
        return _shown(camera, identity, recorder, watched_s)
    began_s = clock.now()
    while clock.now() - began_s < FIRST_FRAME_LIMIT_S and recorder.error is None:
        if clock.wait(recorder.arrived, 0.05):
            break
    recorder.take()
    began_s = clock.now()
    clock.sleep(watched_s if recorder.arrived.is_set() else 0.0)
    batches = recorder.take()
    return Stream(identity, batches, clock.now() - began_s, recorder.take_error(), np.empty(0), np.empty((0, 3)))


def _shown(camera: MocapAdapter, identity: MocapIdentity, recorder: FrameRecorder, watched_s: float) -> Stream:
    """Begin a run, show the camera a vehicle on a straight line, and flush what is late."""
    sampling = call("reset", lambda: camera.reset(Reset(_KEY, _START, Sampling(identity.rate_hz, 0.0))))
    if sampling.rate_hz != identity.rate_hz or not 0.0 <= sampling.phase_s < 1.0 / sampling.rate_hz:
        raise CheckFailedError(f"reset returns {sampling}", "return identity's rate, and a phase within one period")
    true_s = sampling.phase_s + np.arange(int(watched_s * sampling.rate_hz)) / sampling.rate_hz
    way_m = _SPEED_MPS * true_s
    c, s = math.cos(_START.heading_rad), math.sin(_START.heading_rad)
    heading_rad = np.full(len(true_s), _START.heading_rad)
    poses = np.column_stack([_START.x_m + c * way_m, _START.y_m + s * way_m, heading_rad])
    late = Truth(2, 2, watched_s, np.empty(0), np.empty((0, 3)), TruthFlags.LAST | TruthFlags.FLUSH)
    for truth in (Truth(1, 1, watched_s, true_s, poses, TruthFlags.LAST), late):
        call("see", lambda shown=truth: camera.see(shown))  # type: ignore[misc]
    return Stream(identity, recorder.take(), watched_s, recorder.take_error(), true_s, poses)


def stream_checks(stream: Stream) -> Iterator[tuple[str, Callable[[], str]]]:
    """Give the name of each check of frames that arrived, and the check."""
    yield "poses", lambda: _poses(stream)
    yield "capture times", lambda: _times(stream)
    yield "clock", lambda: _clock(stream)
    yield "frame numbers", lambda: _numbers(stream.frames)
    yield "rate", lambda: _rate(stream)


def require_frames(stream: Stream) -> str:
    """Return how many frames arrived.

    Raises
    ------
    CheckFailedError
        If none did; the error that the adapter reported, if it reported one.
    """
    if stream.error is not None:
        raise stream.error
    if not len(stream.frames):
        raise CheckFailedError(
            f"no frame within {FIRST_FRAME_LIMIT_S:g} s of start",
            "start the camera's stream; see the address, the port, and the firewall of this machine",
        )
    return str(summarise(stream.frames, stream.watched_s))


def _poses(stream: Stream) -> str:
    frames = stream.frames
    seen = frames.select(frames.tracked)
    if not len(seen):
        raise CheckFailedError(
            f"none of {len(frames)} frames contains the vehicle", "put the vehicle into view, and name its body"
        )
    poses = np.column_stack([seen.x_m, seen.y_m, seen.heading_rad])
    if not np.isfinite(poses).all():
        raise CheckFailedError("a tracked frame contains a pose that is not finite", "publish it with tracked=False")
    furthest_m = float(np.abs(poses[:, :2]).max())
    if furthest_m > _FURTHEST_M:
        raise CheckFailedError(
            f"position of {furthest_m:g} m (limit: {_FURTHEST_M:g} m)", "convert millimetres to metres"
        )
    widest_rad = float(np.abs(poses[:, 2]).max())
    if widest_rad > 2.0 * math.pi:
        raise CheckFailedError(f"heading of {widest_rad:g} rad (limit: 2π)", "convert degrees to radians, and wrap it")
    return f"finite in {len(seen)} of {len(frames)} frames{_compared(stream, seen)}"


def _compared(stream: Stream, seen: Frames) -> str:
    """Return how far the poses of a simulated camera are from the true ones."""
    if not len(stream.true_s):
        return f", within {np.abs([seen.x_m, seen.y_m]).max():.2f} m of the origin"
    true_m = [np.interp(seen.t_s, stream.true_s, stream.true_poses[:, axis]) for axis in (0, 1)]
    off_m = float(np.median(np.hypot(seen.x_m - true_m[0], seen.y_m - true_m[1])))
    if off_m > _TRUE_WITHIN_M:
        raise CheckFailedError(
            f"poses are {off_m:.3f} m from the true ones (limit: {_TRUE_WITHIN_M:g} m)", "compare the units and axes"
        )
    return f", {off_m * 1e3:.1f} mm from the true poses"


def _require_in_order(what: str, share: float, remedy: str) -> None:
    """Raise if the `share` of frames in which something increases is too small."""
    if share < _SHARE_IN_ORDER:
        raise CheckFailedError(
            f"{what} increase in {100.0 * share:.0f} % of the frames (limit: {100.0 * _SHARE_IN_ORDER:g} %)", remedy
        )


def _times(stream: Stream) -> str:
    t_s = stream.frames.t_s
    if not np.isfinite(t_s).all():
        raise CheckFailedError("a capture time is not finite", "give the time of the exposure, or that of the arrival")
    steps_s = np.diff(t_s)
    share = float(np.mean(steps_s > 0.0)) if len(steps_s) else 0.0
    remedy = "give each frame the time of its own exposure, and publish frames once and in order"
    _require_in_order("capture times", share, remedy)
    return f"increase, by {np.median(steps_s) * 1e3:.2f} ms from frame to frame"


def _clock(stream: Stream) -> str:
    """Compare capture times with the host's clock, or in a simulation with the run's."""
    expected = FrameClock.RUN if stream.identity.simulated else FrameClock.ADAPTER
    clocks = {batch.clock for batch in stream.batches if len(batch.frames)}
    if clocks != {expected}:
        given = " and ".join(f"FrameClock.{FrameClock(one).name}" for one in clocks)
        raise CheckFailedError(f"capture times are in {given}", f"pass clock=FrameClock.{expected.name}")
    if stream.identity.simulated:
        return "that of the run"
    ages_s = np.concatenate([batch.reported_s - batch.frames.t_s for batch in stream.batches])
    age_s = float(np.median(ages_s))
    if not -_NEWEST_S <= age_s <= _OLDEST_S:
        raise CheckFailedError(
            f"frames are published {age_s:.3f} s after their capture (limit: {-_NEWEST_S:g} to {_OLDEST_S:g} s)",
            "convert the camera's times to options.clock, the monotonic clock of this machine",
        )
    return f"that of this machine; frames are published {age_s * 1e3:.2f} ms after their capture"


def _numbers(frames: Frames) -> str:
    if (frames.frame == -1).all():
        return "unknown (−1): frames that are lost cannot be counted"
    steps = np.diff(frames.frame)
    share = float(np.mean(steps > 0)) if len(steps) else 1.0
    _require_in_order("frame numbers", share, "give the camera's own count, or −1 where it has none")
    return f"increase from {frames.frame[0]} to {frames.frame[-1]}; {int(np.sum(np.maximum(steps - 1, 0)))} missing"


def _rate(stream: Stream) -> str:
    nominal_hz, rate_hz = stream.identity.rate_hz, summarise(stream.frames, stream.watched_s).rate_hz
    low, high = _RATE_RATIOS
    if not low * nominal_hz <= rate_hz <= high * nominal_hz:
        raise CheckFailedError(
            f"{rate_hz:.1f} frames/s, nominal {nominal_hz:g} Hz (limit: {low:g} to {high:g} of the nominal rate)",
            "state the camera's rate in identity; if it is right, look for lost frames",
        )
    return f"{rate_hz:.1f} frames/s, nominal {nominal_hz:g} Hz"
