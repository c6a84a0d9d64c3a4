"""``serial:PORT``: a vehicle with the project's firmware at a serial port, as in ``serial:/dev/ttyACM0``."""

from __future__ import annotations

import threading

from agvbench.adapters.contract import SILENCE_LIMIT_S, AdapterOptions, AgvAdapter, AgvReports
from agvbench.adapters.serial_line.conversation import Conversation
from agvbench.adapters.serial_line.dialect import check_channels
from agvbench.adapters.serial_line.port import SerialPort
from agvbench.bus.clock import Clock
from agvbench.bus.counters import RateLimitedCounter
from agvbench.bus.messages.command import CommandFlags, CommandMessage
from agvbench.bus.messages.event import VEHICLE_STOPPED_ITSELF, Level
from agvbench.bus.messages.identity import AgvIdentity
from agvbench.errors import AgvbenchError, LinkError

GREETING_LIMIT_S = 4.0
"""A board that resets when its port is opened spends 1.6 s in its boot loader."""
_ATTEMPT_S = 0.4
_QUIET_S = 0.1


class SerialAgv(AgvAdapter):
    """A vehicle at a serial port, in real time.

    A thread reads what the vehicle says. The first failure stays: commands after it fail at once, with the same words.

    Parameters
    ----------
    port
        Open.
    options
        Their ``channels`` take microseconds; ``clock`` is what waits.
    """

    scheme = "serial"

    def __init__(self, port: SerialPort, options: AdapterOptions) -> None:
        self._port, self._options = port, options
        self._clock: Clock = options.clock
        self._neutral = options.channels.neutral
        self._lock, self._closed = threading.Lock(), threading.Event()
        self._failure: AgvbenchError | None = None
        self._reports: AgvReports | None = None
        self._conversation = Conversation(port.path)
        self._greet()
        self.hello = self._conversation.begin()
        self.watchdog_s = self._conversation.watchdog_s or SILENCE_LIMIT_S
        self._counters = (RateLimitedCounter(), RateLimitedCounter())
        self._reported = self._counts()  # half a line of a banner, heard while greeting, is no error
        self._thread = threading.Thread(target=self._listen, name="agvbench-serial", daemon=True)

    def _greet(self) -> None:
        """Request the vehicle's identity until it answers and is quiet after that."""
        clock, conversation = self._clock, self._conversation
        began_s = heard_s = clock.now()
        attempts = 0
        while (now_s := clock.now()) - began_s < GREETING_LIMIT_S:
            if not conversation.is_greeted and now_s - began_s >= attempts * _ATTEMPT_S:
                self._port.write(conversation.greeting(attempts))
                attempts += 1
            if data := self._port.read():
                heard_s = clock.now()
                conversation.receive(data, heard_s)
            elif conversation.is_greeted and now_s - heard_s > _QUIET_S:
                return

    @property
    def line(self) -> SerialPort:
        """The line, for faults to rehearse with."""
        return self._port

    @classmethod
    def open(cls, address: str, options: AdapterOptions) -> SerialAgv:
        """Open the port `address` and greet the vehicle."""
        if not address:
            raise LinkError("which serial port?", where=cls.scheme, remedy="write serial:/dev/ttyACM0")
        check_channels(options.channels, where=cls.scheme)
        port = SerialPort(address)
        try:
            return cls(port, options)
        except BaseException:
            port.close()
            raise

    def identity(self) -> AgvIdentity:
        """Return the vehicle's identity, with its firmware's."""
        hello, options = self.hello, self._options
        return AgvIdentity(
            vehicle=options.vehicle,
            adapter=self.scheme,
            firmware=f"agvbench {hello.firmware_version}",
            calibration_hash=options.calibration_hash,
            channels=options.channels,
            simulated=False,
            lock_step=False,
            extra={
                "port": self._port.path,
                "firmware_calibration": hello.calibration_hash,
                "firmware_unit": hello.unit,
            },
        )

    def start(self, reports: AgvReports) -> None:
        """Begin to listen."""
        self._reports = reports
        self._thread.start()

    def apply(self, message: CommandMessage) -> None:
        """Send the command; said again, it keeps the vehicle's watchdog quiet."""
        if message.flags & CommandFlags.FLUSH:
            return
        with self._lock:
            if self._failure is not None:
                raise self._failure
            line = self._conversation.command(message.command, self._clock.now())
            try:
                self._port.write(line)
            except LinkError as error:
                self._failure = error
                raise

    def stop(self) -> None:
        """Send neutral, even where everything has failed before: the vehicle may still hear it."""
        with self._lock:
            try:
                self._port.write(self._conversation.command(self._neutral, self._clock.now()))
            except LinkError as error:
                self._failure = self._failure or error

    def close(self) -> None:
        """Give the port back."""
        self._closed.set()
        if self._thread.is_alive():
            self._thread.join()
        self._port.close()

    def _listen(self) -> None:
        while not self._closed.is_set():
            try:
                # An answer that had come by then is in what is read: a process that was suspended blames no vehicle.
                before_s = self._clock.now()
                data = self._port.read()
                with self._lock:
                    now_s = self._clock.now()
                    if again := self._conversation.receive(data, now_s):
                        self._port.write(again)
                    self._conversation.check(before_s)
            except LinkError as error:
                if self._closed.is_set():
                    return
                self._fail(error)
                return
            self._report()

    def _fail(self, error: LinkError) -> None:
        """Keep the first failure, say it, and try to stop the vehicle: it may hear what it cannot answer."""
        with self._lock:
            self._failure = self._failure or error
        self.stop()
        if self._reports is not None:
            self._reports.failed(error)

    def _report(self) -> None:
        """Report what went wrong and was made good, seldom where there is much of it."""
        now = self._counts()
        if now == self._reported or self._reports is None:
            return
        kinds = (
            ("line_garbled", "the vehicle said something garbled"),
            ("command_resent", "the vehicle heard something garbled; the command was sent again"),
        )
        for (kind, text), counter, count, before in zip(
            kinds, self._counters, now[:2], self._reported[:2], strict=True
        ):
            if count > before and counter.add(count - before):
                self._reports.event(Level.WARNING, kind, f"{text} ({counter})")
        if now[2] > self._reported[2]:  # each of them spoils a run: all are reported
            gap_s, limit_s = self._conversation.bitten_after_s, self.watchdog_s
            text = f"the vehicle's watchdog stopped it: {gap_s:.2f} s between two commands (limit: {limit_s:g} s)"
            self._reports.event(Level.WARNING, VEHICLE_STOPPED_ITSELF, text)
        self._reported = now

    def _counts(self) -> tuple[int, int, int]:
        conversation = self._conversation
        return conversation.garbled, conversation.resent, conversation.watchdog_bites
