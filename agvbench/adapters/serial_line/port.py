"""The serial port itself: opened, read and written with errors in one line."""

from __future__ import annotations

import errno
from collections.abc import Callable
from typing import Any

from agvbench.errors import LinkError

BAUD = 115200
READ_LIMIT_S = 0.02
WRITE_LIMIT_S = 0.2


class SerialPort:
    """A port to a vehicle. Reading waits for `READ_LIMIT_S` at most.

    Parameters
    ----------
    path
        As in ``/dev/ttyACM0``.

    Raises
    ------
    LinkError
        If there is no such port, it may not be opened, or another process has it.

    Attributes
    ----------
    wire
        What becomes of bytes on their way to the vehicle: nothing, unless a fault of the line is injected.
    """

    def __init__(self, path: str) -> None:
        import serial

        self.path = path
        self.wire: Callable[[bytes], bytes] = bytes
        try:
            self._port: Any = serial.Serial(
                path, BAUD, timeout=READ_LIMIT_S, write_timeout=WRITE_LIMIT_S, exclusive=True
            )
        except (serial.SerialException, OSError, ValueError) as error:
            raise _cannot_open(path, error) from error
        self._stalled = serial.SerialTimeoutException
        self._broken = (serial.SerialException, OSError, TypeError)  # TypeError: closed while it was read

    def read(self) -> bytes:
        """Return what has arrived, or ``b""`` after a short wait."""
        try:
            data: bytes = self._port.read(self._port.in_waiting or 1)
        except self._broken as error:
            raise self._gone() from error
        return data

    def write(self, data: bytes) -> None:
        """Send `data`."""
        try:
            self._port.write(self.wire(data))
        except self._stalled:
            raise LinkError(
                "the vehicle takes no more bytes", where=self.path, value=f"waited {WRITE_LIMIT_S:g} s",
                remedy="see whether its program hangs: reset the board, and start the adapter again",
            ) from None  # fmt: skip
        except self._broken as error:
            raise self._gone() from error

    def press_reset(self) -> None:
        """Reset the board, as most do when this line of the port falls."""
        try:
            self._port.dtr = False
            self._port.dtr = True
        except self._broken as error:
            raise self._gone() from error

    def pull(self) -> None:
        """Close the port behind everybody's back, as a cable that is pulled out does."""
        self._port.close()

    def close(self) -> None:
        """Give the port back."""
        self._port.close()

    def _gone(self) -> LinkError:
        return LinkError(
            "the serial port is gone", where=self.path, remedy="plug the vehicle in again, and start the adapter again"
        )


_REMEDIES = {
    errno.ENOENT: ("no such serial port", "plug the vehicle in; ports are /dev/ttyACM* or /dev/ttyUSB*"),
    errno.EACCES: ("serial port may not be opened", "join the group dialout: sudo usermod -aG dialout $USER"),
    errno.EBUSY: ("serial port is in use", "end the other program"),
    errno.EWOULDBLOCK: ("serial port is in use", "end the other program"),
    errno.ENOTTY: ("not a serial port", "ports are /dev/ttyACM* or /dev/ttyUSB*"),
}


def _cannot_open(path: str, error: Exception) -> LinkError:
    number = getattr(error, "errno", None)
    if number is None and "configure" in str(error):  # a file or device without settings of a line
        number = errno.ENOTTY
    if number in _REMEDIES:
        what, remedy = _REMEDIES[number]
        return LinkError(what, where=path, remedy=remedy)
    return LinkError("serial port cannot be opened", where=path, value=error)
