"""The simulated microcontroller, in a process of its own (it is linked to simavr, which is under the GPL)."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from agvbench.adapters.simavr.firmware_files import HOST, VERSIONS, built
from agvbench.errors import AdapterGoneError, LinkError, OneOf

CYCLES_PER_S = 16e6


class Pulse(NamedTuple):
    """A servo pulse on channel 0 drive, 1 front or 2 rear; `rise` and `fall` in cycles since the reset."""

    channel: int
    rise: int
    fall: int

    @property
    def width_us(self) -> float:
        """How long it was [µs]."""
        return (self.fall - self.rise) * 1e6 / CYCLES_PER_S


class Ran(NamedTuple):
    """What came of a run: the pulses that ended, the cycle it stopped at, the bytes sent since the reset."""

    pulses: list[Pulse]
    cycle: int
    bytes_sent: int


class SimavrHost:
    """The process ``firmware/build/simavr_host`` with one firmware; its serial port is at `port`.

    Parameters
    ----------
    version
        ``"1"`` or ``"2"``.
    live
        Whether time passes by itself, as real time does, rather than in `run`; then `pulses` come as they end.

    Raises
    ------
    LinkError
        If there is no such firmware, or it is not built.
    """

    def __init__(self, version: str = "2", *, live: bool = False) -> None:
        if version not in VERSIONS:
            raise LinkError("no such firmware", where="simavr", value=repr(version), limit=OneOf(VERSIONS))
        program, firmware = built(HOST), built(f"agv{version}.elf")
        self._ended: AdapterGoneError | None = None
        self.process = _start(program, firmware, *(["--live"] if live else []))
        word, self.port = self._line()
        if word != "port":
            raise self._gone()

    def run(self, cycle: int, bytes_written: int) -> Ran:
        """Let time pass until `cycle`, once the port has taken `bytes_written` bytes since the reset."""
        return self._order(f"run {cycle} {bytes_written}")

    def reset(self, bytes_written: int = 0) -> None:
        """Press the reset button: cycles and bytes count from 0 again, and what was written before is dropped."""
        self._order(f"reset {bytes_written}")

    def pulses(self) -> Iterator[Pulse]:
        """Yield the pulses of a `live` microcontroller as they end, until it does."""
        assert self.process.stdout is not None  # noqa: S101  (it is a pipe)
        for line in self.process.stdout:
            if line.endswith("\n"):  # not cut off by the process's end
                _, *numbers = line.split()
                yield Pulse(*map(int, numbers))

    def close(self) -> None:
        """End the process."""
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                with suppress(OSError):  # what is still to be written to a process that has ended
                    pipe.close()
        try:
            self.process.wait(5.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        if self.process.stderr is not None:
            self.process.stderr.close()

    def _order(self, order: str) -> Ran:
        assert self.process.stdin is not None  # noqa: S101  (it is a pipe)
        if self._ended is not None:
            raise self._ended
        try:
            self.process.stdin.write(order + "\n")
            self.process.stdin.flush()
        except OSError as error:
            raise self._gone() from error
        pulses: list[Pulse] = []
        while True:
            word, *numbers = self._line()
            if word == "at":
                return Ran(pulses, int(numbers[0]), int(numbers[1]))
            pulses.append(Pulse(*map(int, numbers)))

    def _line(self) -> list[str]:
        assert self.process.stdout is not None  # noqa: S101  (it is a pipe)
        words = self.process.stdout.readline().split()
        if not words:
            raise self._gone()
        return words

    def _gone(self) -> AdapterGoneError:
        """Return why nothing can be asked any more: the same words every time."""
        if self._ended is None:
            self._ended = self._end()
        return self._ended

    def _end(self) -> AdapterGoneError:
        self.process.kill()
        self.process.wait()
        assert self.process.stderr is not None  # noqa: S101  (it is a pipe)
        said = self.process.stderr.read().strip().splitlines()
        return AdapterGoneError(
            "the simulated microcontroller has ended", where="simavr", value=said[-1] if said else None
        )


def _start(program: Path, *arguments: object) -> subprocess.Popen[str]:
    pipe = subprocess.PIPE
    command = [str(program), *map(str, arguments)]
    try:
        # A session of its own: Ctrl-C in a terminal is for us, and the vehicle is stopped before it ends.
        return subprocess.Popen(  # noqa: S603  (our own program)
            command, stdin=pipe, stdout=pipe, stderr=pipe, text=True, start_new_session=True
        )
    except OSError as error:
        raise LinkError("cannot start the simulated microcontroller", where=program, value=error.strerror) from error
