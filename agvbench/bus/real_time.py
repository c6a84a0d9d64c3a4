"""Exchanges in real time: publish, then collect frames; with heartbeat and clock offset of the adapter."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from agvbench.bus.clock import Clock, wait_until
from agvbench.bus.counters import RateLimitedCounter
from agvbench.bus.inbox import Inbox
from agvbench.bus.keys import AGV, MOCAP, TIME, Keys
from agvbench.bus.liveliness import Liveliness
from agvbench.bus.messages.command import CommandFlags
from agvbench.bus.messages.event import Event, Level
from agvbench.bus.messages.frames import FramesMessage, unpack_columns
from agvbench.bus.messages.request import decode_time
from agvbench.bus.outbox import CommandOutbox
from agvbench.bus.queries import ask
from agvbench.errors import AdapterGoneError, AgvbenchError, LinkError, MessageError, RunStoppedError
from agvbench.types import Command, Frames

KEEP_ALIVE_S = 0.1
LATE_FRAMES_S = 0.1
_BYTES_KEPT = 16 << 20
_BYTES_EACH = 48


class Failure:
    """What failed while a run was driven: noted by threads that receive, raised in the one that drives."""

    def __init__(self) -> None:
        self._error: AgvbenchError | None = None
        # Without it, what ends the session could be noted, and forgotten, between a look at what ends the run and its
        # removal.
        self._lock = threading.Lock()

    def note(self, error: AgvbenchError) -> None:
        """Keep what failed first, and rather what ends the session than what ends one run."""
        with self._lock:
            if self._error is None or isinstance(self._error, RunStoppedError):
                self._error = error

    def check(self) -> None:
        """Raise what failed, if anything did: what ends one run once, what ends the session again and again."""
        with self._lock:
            error = self._error
            if isinstance(error, RunStoppedError):
                self._error = None
        if error is not None:
            raise error

    def forget_run(self) -> None:
        """Forget what ended the last run."""
        with self._lock:
            if isinstance(self._error, RunStoppedError):
                self._error = None

    def forget(self) -> None:
        """Forget whatever failed."""
        with self._lock:
            self._error = None


class RealTime:
    """One command out at its time, kept alive while it holds, and the frames that arrived meanwhile.

    A thread empties the inbox all the time, so that frames carry the time they arrived and a motion capture
    system is never held up by a runner that thinks.
    """

    def __init__(
        self,
        inbox: Inbox,
        outbox: CommandOutbox,
        liveliness: Liveliness,
        *,
        session: Any,
        keys: Keys,
        neutral: Command,
        clock: Clock,
    ) -> None:
        self._inbox, self._outbox, self._liveliness = inbox, outbox, liveliness
        self._session, self._keys, self._clock = session, keys, clock
        self._neutral = neutral
        self._arrived: deque[tuple[float, FramesMessage]] = deque()
        # One is counted by the thread that receives, the other by the one that takes: no lock between them.
        self._came = self._gone = 0
        self.dropped = RateLimitedCounter()
        self._failure = Failure()
        self._start_s: float | None = None
        self._last_t_s = -np.inf
        self._offset_s = 0.0
        self._thread = threading.Thread(target=self._receive, name="agvbench-inbox", daemon=True)
        self._thread.start()
        self._heartbeat = Heartbeat(session, keys.queryable(AGV, TIME), clock, self._failure.note)

    def _receive(self) -> None:
        while True:
            try:
                report = self._inbox.receive()
            except MessageError as error:
                self._inbox.note_malformed(error)
                continue
            except LinkError:
                return
            if isinstance(report, FramesMessage):
                self._keep(report)
            elif isinstance(report, Event):
                self._hear(report)

    def _hear(self, event: Event) -> None:
        if event.level == Level.ERROR:
            self._failure.note(event.as_error())

    def _keep(self, message: FramesMessage) -> None:
        """Keep frames until they are taken; where the runner takes none for long, what comes then is dropped."""
        size = len(message.columns) + _BYTES_EACH
        if self._came - self._gone + size <= _BYTES_KEPT:
            self._came += size
            self._arrived.append((self._clock.now(), message))
        elif self.dropped.add():
            text = f"frames that the runner did not take were dropped: {self.dropped}"
            self._inbox.events.append(Event(0, "runner", Level.WARNING, "frames_dropped", text))

    def start(self) -> None:
        """Forget the last run's clock and what went wrong in it."""
        self._start_s, self._last_t_s = None, -np.inf
        self._failure.forget()

    def control_cycle(self, command: Command, t_s: float, hold_s: float) -> Frames:
        """Publish at `t_s`; return the frames that arrived until `t_s + hold_s`."""
        if self._start_s is None or t_s < self._last_t_s:
            self._begin(t_s)
        assert self._start_s is not None  # noqa: S101  (for the type checker: _begin set it)
        self._last_t_s = t_s
        wait_until(self._clock, self._start_s + t_s)
        self._check()
        self._outbox.send(command, t_s, hold_s)
        end_s = self._start_s + t_s + hold_s
        while (left_s := end_s - self._clock.now()) > KEEP_ALIVE_S:
            self._clock.sleep(min(left_s, KEEP_ALIVE_S))
            self._check()
            self._outbox.send(command, t_s, max(0.0, end_s - self._clock.now()), CommandFlags.KEEP_ALIVE)
        wait_until(self._clock, end_s)
        return self._take()

    def _begin(self, t_s: float) -> None:
        self._failure.forget_run()
        self._offset_s = measure_offset(self._session, self._keys.queryable(MOCAP, TIME), self._clock)
        while self._arrived:
            self._next()
        self._start_s = self._clock.now() - t_s

    def flush(self) -> Frames:
        """Return the frames that arrive within a tenth of a second from now."""
        self._clock.sleep(LATE_FRAMES_S)
        return self._take()

    def stop(self) -> None:
        """Command neutral, and wait for nothing."""
        self._outbox.send(self._neutral, 0.0, 0.0, CommandFlags.STOP)

    def close(self) -> None:
        """Wait for the thread, which ends with its inbox."""
        self._heartbeat.close()
        self._thread.join(timeout=2.0)

    def _check(self) -> None:
        self._liveliness.check(AGV, MOCAP)
        self._failure.check()

    def _next(self) -> tuple[float, FramesMessage]:
        at_s, message = self._arrived.popleft()
        self._gone += len(message.columns) + _BYTES_EACH
        return at_s, message

    def _take(self) -> Frames:
        """Return what has arrived, with its times in the run's clock."""
        start_s, arrived_s, messages = self._start_s or 0.0, [], []
        while self._arrived:
            at_s, message = self._next()
            arrived_s.append(at_s)
            messages.append(message)
        frames = unpack_columns([message.columns for message in messages])
        return replace(
            frames,
            t_s=frames.t_s + (self._offset_s - start_s),
            received_s=np.repeat(arrived_s, [message.count for message in messages]) - start_s,
        )


PERIOD_S = 0.5
ANSWER_LIMIT_S = 1.0


class Heartbeat:
    """Queries `key` again and again, in a thread; calls `on_silent` when no answer comes.

    A vehicle has stopped itself by then: this is for the runner, which would else drive on without one.
    """

    def __init__(self, session: Any, key: str, clock: Clock, on_silent: Callable[[AgvbenchError], None]) -> None:
        self._session, self._key, self._clock, self._on_silent = session, key, clock, on_silent
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._beat, name="agvbench-heartbeat", daemon=True)
        self._thread.start()

    def _beat(self) -> None:
        while not self._clock.wait(self._closed, PERIOD_S):
            try:
                ask(self._session, self._key, b"", ANSWER_LIMIT_S)
            except AgvbenchError:
                if not self._closed.is_set():
                    self._on_silent(self._silence())

    def _silence(self) -> AdapterGoneError:
        return AdapterGoneError(
            "adapter does not answer any more", where=self._key.rpartition("/")[0],
            value=f"waited {ANSWER_LIMIT_S:g} s",
            remedy="see whether its process hangs or was suspended, then go on with --resume",
        )  # fmt: skip

    def close(self) -> None:
        """Ask no more."""
        self._closed.set()
        self._thread.join(timeout=2.0 * ANSWER_LIMIT_S)


_ROUND_TRIPS = 8
_LIMIT_S = 2.0


def measure_offset(session: Any, key: str, clock: Clock, round_trips: int = _ROUND_TRIPS) -> float:
    """Return what to add [s] to the clock behind `key` to get the time of `clock`.

    The error is at most half of the shortest round trip; the shortest is used, since delays only ever add.

    Raises
    ------
    AdapterGoneError
        If the adapter behind `key` does not answer.

    References
    ----------
    F. Cristian, Probabilistic clock synchronization, Distributed Computing 3, 1989.
    """
    best_s, offset_s = float("inf"), 0.0
    for _ in range(round_trips):
        sent_s = clock.now()
        there_s = decode_time(ask(session, key, b"", _LIMIT_S)).now_s
        trip_s = clock.now() - sent_s
        if trip_s < best_s:
            best_s, offset_s = trip_s, sent_s + trip_s / 2.0 - there_s
    return offset_s
