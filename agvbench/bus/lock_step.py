"""Exchanges with a simulation: time passes only while the runner waits for the frames of one command."""

from __future__ import annotations

from agvbench.bus.clock import SimulatedClock, Watchdog
from agvbench.bus.inbox import Inbox
from agvbench.bus.keys import AGV, MOCAP, Keys
from agvbench.bus.liveliness import SETTLES_S, Liveliness
from agvbench.bus.messages.command import CommandFlags
from agvbench.bus.messages.event import Event, Level
from agvbench.bus.messages.frames import FramesFlags, FramesMessage
from agvbench.bus.outbox import CommandOutbox
from agvbench.errors import AdapterGoneError, LinkError
from agvbench.types import Command, Frames


class LockStep:
    """One command out, the frames of its interval back.

    A simulator that dies ends the wait by its liveliness token, one that hangs by the watchdog.
    """

    def __init__(
        self,
        inbox: Inbox,
        outbox: CommandOutbox,
        liveliness: Liveliness,
        watchdog: Watchdog,
        *,
        keys: Keys,
        neutral: Command,
        clock: object,
    ) -> None:
        self._inbox, self._outbox, self._liveliness, self._watchdog = inbox, outbox, liveliness, watchdog
        self._keys, self._neutral, self._clock = keys, neutral, clock
        self._hung: AdapterGoneError | None = None

    def start(self) -> None:
        """Forget what went wrong before."""
        self._hung = None

    def control_cycle(self, command: Command, t_s: float, hold_s: float) -> Frames:
        """Return the frames that arrive in [t_s, t_s + hold_s)."""
        frames = self._control_cycle(command, t_s, hold_s, CommandFlags.NONE)
        if isinstance(self._clock, SimulatedClock):
            self._clock.sleep(hold_s)
        return frames

    def flush(self) -> Frames:
        """Return the frames that are still under way."""
        return self._control_cycle(self._neutral, 0.0, 0.0, CommandFlags.FLUSH)

    def stop(self) -> None:
        """Command neutral, and wait for nothing."""
        self._outbox.send(self._neutral, 0.0, 0.0, CommandFlags.STOP)

    def close(self) -> None:
        """Nothing to release."""

    def _control_cycle(self, command: Command, t_s: float, hold_s: float, flags: int) -> Frames:
        if self._hung is not None:
            raise self._hung
        self._liveliness.check(AGV, MOCAP, settles_s=SETTLES_S)
        sequence = self._outbox.send(command, t_s, hold_s, flags)
        self._watchdog.arm()
        try:
            return self._collect(sequence)
        finally:
            self._watchdog.disarm()

    def _collect(self, sequence: int) -> Frames:
        batches: list[Frames] = []
        lost = self._inbox.frames_loss.lost
        while True:
            report = self._inbox.receive()
            if isinstance(report, FramesMessage):
                # A wait that was interrupted leaves its answer behind: it belongs to no run any more.
                if report.acknowledged == sequence:
                    batches.append(report.frames())
                    if report.flags & FramesFlags.LAST:
                        break
            elif isinstance(report, Event):
                if report.level == Level.ERROR and report.acknowledged in (0, sequence):
                    raise report.as_error()
            else:
                self._check_waiting()
        if self._inbox.frames_loss.lost != lost:
            lost = self._inbox.frames_loss.lost - lost
            raise LinkError("frames were lost on the bus", where=self._keys.report, value=f"{lost} messages")
        return batches[0] if len(batches) == 1 else Frames.concatenate(batches)

    def _check_waiting(self) -> None:
        self._liveliness.check(AGV, MOCAP, settles_s=SETTLES_S)
        if self._watchdog.expired:
            self._hung = AdapterGoneError(
                "the simulator does not answer",
                where=self._keys.root,
                value=f"waited {self._watchdog.waited_s:.1f} s",
                limit=f"{self._watchdog.limit_s:g} s",
                remedy="see whether its process hangs, or its plant is too slow",
            )
            raise self._hung
