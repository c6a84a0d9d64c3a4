"""The host of a mocap adapter: frames out, numbered, in batches that fit a message."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from agvbench.adapters.contract import MocapAdapter
from agvbench.adapters.frame_recorder import FrameRecorder
from agvbench.adapters.host import Host, checked_identity
from agvbench.bus.clock import Clock
from agvbench.bus.counters import LossCounter, Sequence
from agvbench.bus.keys import MOCAP, RESET, Keys
from agvbench.bus.messages.codec import ENCODING, MAX_ROWS, encode
from agvbench.bus.messages.frames import FrameClock, FramesFlags, FramesMessage, pack_columns, pack_row
from agvbench.bus.messages.identity import MocapIdentity
from agvbench.bus.messages.request import decode_reset
from agvbench.bus.messages.truth import Truth, decode_truth
from agvbench.errors import LinkError, MessageError
from agvbench.types import Frames

_TRUTHS_WAITING = 64
_FIRST_ROWS = np.arange(MAX_ROWS)


class MocapHost(Host):
    """A mocap adapter on the bus.

    Parameters
    ----------
    session, keys, clock
        As for `Host`.
    adapter
        Driven by this host alone; closed with it.
    listens_for_truth
        Whether true poses come over the bus; otherwise `see` is called in this process, or nothing is simulated.
    recorder
        Also receives what the adapter reports.
    """

    def __init__(
        self,
        session: Any,
        keys: Keys,
        adapter: MocapAdapter,
        clock: Clock,
        *,
        listens_for_truth: bool,
        recorder: FrameRecorder | None = None,
    ) -> None:
        import zenoh

        super().__init__(session, keys, MOCAP, clock)
        self._adapter = adapter
        sequence = Sequence()
        self._source, self._take, self._now = sequence.source, sequence.take, clock.now
        self._truth_loss = LossCounter()
        self._identity_bytes = encode(checked_identity(adapter, MOCAP, MocapIdentity))
        self._answers |= {RESET: self._reset}
        self._publisher = session.declare_publisher(
            keys.report,
            encoding=ENCODING,
            congestion_control=zenoh.CongestionControl.BLOCK,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
        )
        self._put_frames = self._publisher.put
        self._subscriber = None
        if listens_for_truth:
            self._subscriber = session.declare_subscriber(keys.truth, zenoh.handlers.FifoChannel(_TRUTHS_WAITING))
            self._run("truth", self._serve_truth)
        reports = self if recorder is None else recorder.before(self)
        self._start_adapter(adapter, lambda: adapter.start(reports))
        self._announce()

    def _identity(self) -> bytes:
        return self._identity_bytes

    def _reset(self, payload: bytes) -> bytes:
        with self._lock:
            return encode(self._adapter.reset(decode_reset(payload)))

    def _serve_truth(self) -> None:
        assert self._subscriber is not None  # noqa: S101  (for the type checker)
        handler = self._subscriber.handler
        while True:
            try:
                payload = handler.recv().payload.to_bytes()
            except self._zenoh_error:
                return
            try:
                self.see(decode_truth(payload))
            except MessageError as error:
                self.failed(error)

    def see(self, truth: Truth) -> None:
        """Let the adapter look at a simulated vehicle."""
        try:
            if lost := self._truth_loss.saw(truth.source, truth.sequence):
                raise LinkError("true poses were lost on the bus", where=self._keys.truth, value=f"{lost} messages")
            with self._lock:
                self._adapter.see(truth)
        except BaseException as error:  # noqa: BLE001  (whatever the adapter raises, the runner must hear of it)
            self.failed(error, acknowledged=truth.acknowledged)

    def frames(self, frames: Frames, *, clock: FrameClock, acknowledged: int = 0) -> None:
        """Publish frames, in as many messages as they need."""
        while len(frames.t_s) > MAX_ROWS:
            first = frames.select(_FIRST_ROWS)
            self._send(MAX_ROWS, pack_columns(first), clock, acknowledged, FramesFlags.NONE)
            frames = frames.select(np.arange(MAX_ROWS, len(frames)))
        self._send(len(frames), pack_columns(frames), clock, acknowledged, FramesFlags.LAST)

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
        """Publish one frame, from plain numbers."""
        columns = pack_row(t_s, x_m, y_m, heading_rad, mean_error_m, received_s, frame, tracked)
        self._send(1, columns, clock, acknowledged, FramesFlags.LAST)

    def _send(self, count: int, columns: bytes, clock: FrameClock, acknowledged: int, flags: int) -> None:
        with self._lock:
            sequence, now_s = self._take(), self._now()
            message = FramesMessage(sequence, count, columns, acknowledged, clock, now_s, flags, self._source)
            try:
                self._put_frames(encode(message))
            except self._zenoh_error:
                return

    def close(self) -> None:
        """Leave the bus, release the adapter."""
        if self._subscriber is not None:
            self._subscriber.undeclare()
        super().close()
        self._close_adapter(self._adapter.close)
