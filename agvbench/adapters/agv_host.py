"""The host of an AGV adapter: commands in, and a vehicle that stops when commands cease."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import Any

from agvbench.adapters.contract import SILENCE_LIMIT_S, AgvAdapter
from agvbench.adapters.host import Host, checked_identity
from agvbench.bus.clock import Clock
from agvbench.bus.counters import LossCounter, RateLimitedCounter, Sequence
from agvbench.bus.keys import AGV, CLAIM, RELEASE, REPLAY, RESET, Keys
from agvbench.bus.messages.codec import encode
from agvbench.bus.messages.command import CommandFlags, CommandMessage, decode_command
from agvbench.bus.messages.event import COMMANDS_LATE, COMMANDS_LOST, RUNNER_SILENT, Level
from agvbench.bus.messages.identity import AgvIdentity
from agvbench.bus.messages.request import decode_claim, decode_replay, decode_reset
from agvbench.bus.messages.truth import Truth, TruthFlags
from agvbench.errors import AdapterGoneError, LinkError, MessageError, RunStoppedError
from agvbench.types import Floats

_COMMANDS_WAITING = 256
_REORDERED_REPORTED = 10
_STOP_PATIENCE_S = 0.5
_HANG_PATIENCE_S = 0.1
_STOP, _FLUSH = CommandFlags.STOP, CommandFlags.FLUSH
_FOREIGN_REPORTED_S = 1.0


class Claim:
    """Which runner has the vehicle: the first that claims it, until it releases it or its token vanishes.

    Parameters
    ----------
    session, keys
        As for `Host`.
    required
        Whether a vehicle that no runner has takes stops only; else it takes every command.

    Attributes
    ----------
    source
        That of the runner's commands; None while no runner has the vehicle.
    """

    def __init__(self, session: Any, keys: Keys, *, required: bool) -> None:
        self.source: int | None = None
        self._keys, self._required, self._lock = keys, required, threading.Lock()
        self._subscriber = session.liveliness().declare_subscriber(keys.runner(), self._token_changed)

    def take(self, payload: bytes) -> bytes:
        """Give the vehicle to the runner that claims it.

        Raises
        ------
        LinkError
            If another runner has it.
        """
        source = decode_claim(payload).source
        with self._lock:
            if self.source not in (None, source):
                raise LinkError(
                    "another runner drives this vehicle", where=self._keys.root,
                    remedy="wait until it has ended, or end it; another vehicle has another --vehicle-name",
                )  # fmt: skip
            self.source = source
        return b""

    def release(self, payload: bytes) -> bytes:
        """Take note that the runner has left."""
        self._end(self._keys.runner(decode_claim(payload).source))
        return b""

    def _token_changed(self, sample: Any) -> None:
        import zenoh

        if sample.kind == zenoh.SampleKind.DELETE:
            self._end(str(sample.key_expr))

    def _end(self, token: str) -> None:
        with self._lock:
            if self.source is not None and token == self._keys.runner(self.source):
                self.source = None

    def is_foreign(self, message: CommandMessage) -> bool:
        """Whether a command is of another source than the runner that has the vehicle."""
        source = self.source
        if source is None:
            return self._required and not message.flags & _STOP
        return message.source != source

    def close(self) -> None:
        """Watch no more tokens."""
        self._subscriber.undeclare()


class AgvHost(Host):
    """An AGV adapter on the bus.

    Parameters
    ----------
    session, keys, clock
        As for `Host`.
    adapter
        Driven by this host alone; closed with it.
    show
        Where true poses go: to the camera in the same process, or onto the bus.
    """

    def __init__(
        self, session: Any, keys: Keys, adapter: AgvAdapter, clock: Clock, show: Callable[[Truth], None]
    ) -> None:
        import zenoh

        super().__init__(session, keys, AGV, clock)
        self._adapter, self._show = adapter, show
        self._truths = Sequence()
        self.loss = LossCounter()
        self.malformed, self.reordered = RateLimitedCounter(), RateLimitedCounter(first=_REORDERED_REPORTED)
        self._heard_s: float | None = None
        identity = checked_identity(adapter, AGV, AgvIdentity)
        self._identity_bytes, self._lock_step = encode(identity), identity.lock_step
        self._neutral = identity.channels.neutral
        self._neutral_drive = self._neutral.drive
        self._gap_limit_s = min(adapter.watchdog_s, SILENCE_LIMIT_S)
        self._rest()
        self._claim = Claim(session, keys, required=not self._lock_step)
        self.foreign, self._foreign_reported = 0, (False, -math.inf)
        self._answers |= {RESET: self._reset, REPLAY: self._replay}
        self._answers |= {CLAIM: self._take, RELEASE: self._claim.release}
        self._subscriber = session.declare_subscriber(keys.command, zenoh.handlers.FifoChannel(_COMMANDS_WAITING))
        self._closed, self._left = threading.Event(), False
        self._outdated: dict[int, int] = {}  # by source: the last command sent before the vehicle was placed anew
        self._reported_hanging = False
        self._start_adapter(adapter, lambda: adapter.start(self))
        self._run("commands", self._serve_commands)
        if not self._lock_step:
            self._run("watchdog", self._watch)
        self._announce()

    def _identity(self) -> bytes:
        return self._identity_bytes

    def _take(self, payload: bytes) -> bytes:
        """Give the vehicle to a runner; what the one before left unfinished is not its concern."""
        answer = self._claim.take(payload)
        self._rest()
        return answer

    def _rest(self) -> None:
        """Take note that the vehicle stands: no gap between commands counts, and none was reported."""
        self._drives = self._holds = False
        self._held_s, self._longest_s = math.nan, 0.0

    def _reset(self, payload: bytes) -> bytes:
        request = decode_reset(payload)
        with self._lock:
            self._rest()
            self._outdated = {request.source: request.after}
            self._adapter.reset(request)
        return b""

    def _replay(self, payload: bytes) -> bytes:
        request = decode_replay(payload)
        with self._lock:
            self._outdated = {request.reset.source: request.reset.after}
            self._adapter.replay(request)
        return b""

    def _serve_commands(self) -> None:
        # One function from the command to the adapter, and the adapter first, the book-keeping after: the thread has
        # just been woken, so that each further function, name and object is fetched from memory while the runner waits.
        receive, apply, lock = self._subscriber.handler.recv, self._adapter.apply, self._lock
        loss, watched, now, claim = self.loss, not self._lock_step, self._clock.now, self._claim
        while True:
            try:
                message = self._decode(receive().payload.to_bytes())
                if watched:
                    message = self._newest(message)
            except self._zenoh_error:
                return
            if message is None:
                continue
            if claim.is_foreign(message):
                self._pass_over(message)
                continue
            sequence, flags, source = message.sequence, message.flags, message.source
            try:
                with lock:
                    if flags & _STOP or self._left or sequence <= self._outdated.get(source, 0):
                        self._refrain(message)
                    else:
                        if watched:
                            self._heard_s = now()
                        apply(message)
                        self._drives = message.command.drive != self._neutral_drive
                        self._holds = message.command != self._neutral
            except BaseException as error:  # noqa: BLE001  (whatever the adapter raises, the runner must hear of it)
                self.failed(error, acknowledged=sequence)
            if sequence == loss.expected and source == loss.source:
                loss.expected += 1
            else:
                self._note(source, sequence)
            if watched and not flags & _FLUSH:  # which the vehicle does not hear
                self._check_gap()

    def _check_gap(self) -> None:
        """Report commands that were carried out further apart than the vehicle's watchdog allows.

        It watches while any channel is away from neutral: wheels that were turned before the vehicle drives go straight
        where it bites.
        """
        now_s = self._clock.now()
        gap_s = now_s - self._held_s  # NaN, and so never too long, where all was neutral
        if gap_s > max(self._gap_limit_s, self._longest_s):
            self._longest_s = gap_s
            text = f"{gap_s:.2f} s between two commands (limit: {self._gap_limit_s:g} s, then the vehicle stops itself)"
            self.event(Level.WARNING, COMMANDS_LATE, text)
        self._held_s = now_s if self._holds else math.nan
        if not self._holds:
            self._longest_s = 0.0

    def _decode(self, payload: bytes) -> CommandMessage | None:
        """Return the command; None if it is malformed, which is reported, seldom if there are many."""
        try:
            return decode_command(payload)
        except MessageError as error:
            if self.malformed.add():
                what = error.what if self.malformed.count == 1 else f"{error.what} ({self.malformed})"
                self.failed(MessageError(what, value=error.value, limit=error.limit, remedy=error.remedy))
            return None

    def _newest(self, message: CommandMessage | None) -> CommandMessage | None:
        """Return the last of the commands that wait, in real time: older ones are of no use to anybody, but stops are.

        A flood, or an adapter that is slower than its runner, therefore never holds up a stop by what waits before it.
        """
        try_receive = self._subscriber.handler.try_recv
        for _ in range(_COMMANDS_WAITING):
            sample = try_receive()
            if sample is None:
                break
            later = self._decode(sample.payload.to_bytes())
            if later is None:
                continue
            if message is None or not self._claim.is_foreign(later):
                message, later = later, message
            if later is not None:
                self._pass_over(later)
        return message

    def _pass_over(self, message: CommandMessage) -> None:
        foreign = self._claim.is_foreign(message)
        if foreign:
            self._report_foreign(message)
        else:
            self._note(message.source, message.sequence)
        if message.flags & _STOP:
            try:
                with self._lock:
                    self._refrain(message)
            except BaseException as error:  # noqa: BLE001  (as for every command)
                self.failed(error, acknowledged=message.sequence)
        elif not foreign and self.reordered.add():
            text = f"commands superseded by newer ones: {self.reordered}"
            self.event(Level.WARNING, "commands_overtaken", text)

    def _report_foreign(self, message: CommandMessage) -> None:
        """Report commands that are not the runner's, at most once a second: an error while the vehicle drives."""
        self.foreign += 1
        (reported_while_driving, reported_s), now_s = self._foreign_reported, self._clock.now()
        if now_s - reported_s < _FOREIGN_REPORTED_S and reported_while_driving >= self._drives:
            return
        self._foreign_reported = self._drives, now_s
        error = RunStoppedError(
            "commands of another source", where=self._keys.command, value=f"{self.foreign}, of {message.source:08x}",
            limit="only those of the runner that has the vehicle", remedy="end the program that sends them",
        )  # fmt: skip
        if self._drives:
            self.failed(error)
        else:
            self.event(Level.WARNING, "foreign_commands", str(error))

    def _note(self, source: int, sequence: int) -> None:
        if lost := self.loss.saw(source, sequence):
            self.event(Level.WARNING, COMMANDS_LOST, f"{lost} commands were lost before {sequence}")

    def _refrain(self, message: CommandMessage) -> None:
        """Stop, unless the command came too late for that, too."""
        if self._left or message.sequence <= self._outdated.get(message.source, 0):
            return  # the vehicle was placed anew after this was sent: a runner was interrupted in between
        self._heard_s = None
        self._rest()
        self._adapter.stop()

    def _watch(self) -> None:
        """Stop a vehicle whose runner has left or fallen silent, or whose adapter does not come back from a command."""
        while not self._clock.wait(self._closed, SILENCE_LIMIT_S / 5.0):
            if not self._is_silent():
                continue
            try:
                self._stop_unheard()
            except Exception as error:  # noqa: BLE001  (the watchdog's thread must go on, whatever a stop raises)
                self.failed(error)

    def _is_silent(self) -> bool:
        heard_s = self._heard_s
        if heard_s is None:
            return False
        return self._claim.source is None or self._clock.now() - heard_s > SILENCE_LIMIT_S

    def _stop_unheard(self) -> None:
        if not self._lock.acquire(timeout=_HANG_PATIENCE_S):
            # Neither may wait for the other: a stop may need what the command holds, and so may an event. Silence lasts
            # until there was a stop with nothing else under way: what hangs may come back, and drive.
            if not self._reported_hanging:
                self._reported_hanging = True
                threading.Thread(target=self._report_hanging, daemon=True).start()
            self._adapter.stop()
            return
        try:
            self._reported_hanging = False
            if not self._is_silent():
                return
            self._adapter.stop()
            self._heard_s = None
            drove, self._drives, self._holds = self._drives, False, False
        finally:
            self._lock.release()
        if drove:
            why = "its runner is gone" if self._claim.source is None else f"no command for {SILENCE_LIMIT_S} s"
            self.event(Level.WARNING, RUNNER_SILENT, f"{why}: vehicle stopped")

    def _report_hanging(self) -> None:
        error = AdapterGoneError(
            "does not come back from a command", value=f"{SILENCE_LIMIT_S + _HANG_PATIENCE_S:g} s",
            remedy="see the vehicle and its cable, and start the adapter again",
        )  # fmt: skip
        self.failed(error)

    def truth(
        self, t_s: Floats, poses: Floats, *, end_s: float, acknowledged: int = 0, flags: int = TruthFlags.LAST
    ) -> None:
        """Show true poses to the camera."""
        source = self._truths.source
        self._show(Truth(self._truths.take(), acknowledged, end_s, t_s, poses, flags, source))

    def close(self) -> None:
        """Stop the vehicle, leave the bus, release the adapter."""
        self._left = True
        self._closed.set()
        # An adapter that hangs in a command must not keep the vehicle from being stopped.
        locked = self._lock.acquire(timeout=_STOP_PATIENCE_S)
        try:
            self._adapter.stop()
        finally:
            if locked:
                self._lock.release()
            self._subscriber.undeclare()
            self._claim.close()
            super().close()
            self._close_adapter(self._adapter.close)
