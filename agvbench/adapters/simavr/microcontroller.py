"""The firmware and the conversation with it, in lock step: time passes only in `Microcontroller.run_until`."""

from __future__ import annotations

from collections.abc import Callable

from agvbench.adapters.serial_line.conversation import Conversation
from agvbench.adapters.serial_line.replies import Hello
from agvbench.adapters.simavr.host import CYCLES_PER_S, Pulse, SimavrHost
from agvbench.errors import LinkError
from agvbench.types import Command

BAUD = 115200
_SETTLE_S = 0.02
_ATTEMPTS = 10
_READ_LIMIT_S = 5.0


class Microcontroller:
    """The firmware behind a real serial port, in simulated time.

    Bytes are written to a pseudo-terminal and read from it as with hardware; the counts of bytes that both sides
    exchange beside it say when all of them have arrived. So the same commands give the same pulses, to the cycle.

    Parameters
    ----------
    version
        Of the firmware, ``"1"`` or ``"2"``.

    Attributes
    ----------
    wire
        What becomes of bytes on their way to the firmware: nothing, unless a fault of the line is injected.
    """

    def __init__(self, version: str = "2") -> None:
        import serial

        self.host = SimavrHost(version)
        self.wire: Callable[[bytes], bytes] = bytes
        self._written = self._read = 0
        self._began_cycle = 0
        try:
            self._port = serial.Serial(self.host.port, BAUD, timeout=_READ_LIMIT_S)
            self.hello: Hello = self.reset()
        except BaseException:
            self.host.close()
            raise

    def reset(self) -> Hello:
        """Press the reset button, and wait until firmware and conversation have greeted each other."""
        self._press()
        self.now_s, self._began_cycle = 0.0, 0
        self.conversation = Conversation(self.host.port)
        self.run_until(_SETTLE_S)  # what comes before the firmware listens is lost
        for attempt in range(_ATTEMPTS):
            self._write(self.conversation.greeting(attempt))
            self.run_until(self.now_s + _SETTLE_S)
            if self.conversation.is_greeted:
                break
        return self.conversation.begin()

    def press_reset(self) -> None:
        """Press the reset button and nothing else: time goes on, the conversation has to find out."""
        self._began_cycle = round(self.now_s * CYCLES_PER_S)
        self._press()

    def _press(self) -> None:
        self.host.reset(self._written)
        self._written = self._read = 0

    def pull(self) -> None:
        """End the process, as a cable that is pulled out ends a port."""
        self.host.process.kill()

    def set_command(self, command: Command) -> None:
        """Send a command [µs] now."""
        self._write(self.conversation.command(command, self.now_s))

    def run_until(self, end_s: float) -> list[Pulse]:
        """Let time pass until `end_s` [s] since the reset; return the pulses that ended.

        Raises
        ------
        LinkError
            If the firmware refuses a command or does not answer.
        AdapterGoneError
            If the process has ended.
        """
        data, pulses = self.exchange(b"", end_s)
        if again := self.conversation.receive(data, self.now_s):
            self._write(again)
        self.conversation.check(self.now_s)
        return pulses

    def exchange(self, data: bytes, end_s: float) -> tuple[bytes, list[Pulse]]:
        """Send bytes as they are and let time pass until `end_s` [s]; return what came back, and the pulses that ended.

        The conversation hears nothing of it.
        """
        self._write(data)
        ran = self.host.run(round(end_s * CYCLES_PER_S) - self._began_cycle, self._written)
        self.now_s = max(self.now_s, end_s)
        count, self._read = ran.bytes_sent - self._read, ran.bytes_sent
        heard: bytes = self._port.read(count)
        if len(heard) != count:
            raise LinkError(
                "bytes were lost in the pseudo-terminal", where=self.host.port, value=len(heard), limit=count
            )
        return heard, [self._since_run_began(pulse) for pulse in ran.pulses] if self._began_cycle else ran.pulses

    def _since_run_began(self, pulse: Pulse) -> Pulse:
        return pulse._replace(rise=pulse.rise + self._began_cycle, fall=pulse.fall + self._began_cycle)

    def _write(self, data: bytes) -> None:
        arriving = self.wire(data)
        self._port.write(arriving)
        self._written += len(arriving)

    def close(self) -> None:
        """End the process."""
        self._port.close()
        self.host.close()
