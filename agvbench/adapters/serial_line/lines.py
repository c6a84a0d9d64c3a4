"""Lines on the wire: printable ASCII up to a newline, optionally ``*`` and four digits of checksum before it."""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Iterator

MAX_LINE = 80
"""No line of the firmware is longer; more than that without a newline is noise."""
_KEPT_OF_NOISE = 40


def encode_line(text: str, *, checksum: bool) -> bytes:
    r"""Return `text` as the firmware reads it.

    The checksum is CRC-16/XMODEM (polynomial 0x1021, begins with 0) over what is before the ``*``.

    >>> encode_line("V", checksum=False), encode_line("V", checksum=True)
    (b'V\n', b'V*3A33\n')
    """
    data = text.encode("ascii")
    return data + b"*%04X\n" % crc_hqx(data, 0) if checksum else data + b"\n"


def decode_line(line: bytes, *, checksum: bool) -> str | None:
    """Return the text of a line without its newline; None if it is garbled, or bare where `checksum` is expected.

    >>> decode_line(b"V*3A33", checksum=True), decode_line(b"W*3A33", checksum=True), decode_line(b"V", checksum=True)
    ('V', None, None)
    """
    data, star, digits = line.partition(b"*")
    if not all(32 <= byte < 127 for byte in line) or (checksum and not star):
        return None
    if star and digits != b"%04X" % crc_hqx(data, 0):
        return None
    return data.decode("ascii")


class LineSplitter:
    r"""Cuts a stream of bytes into lines, however it arrives.

    >>> splitter = LineSplitter()
    >>> list(splitter.feed(b"ok 1\nok")), list(splitter.feed(b" 2\n"))
    ([b'ok 1'], [b'ok 2'])
    """

    def __init__(self) -> None:
        self._begun = b""

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Return the lines that `data` completes; more than `MAX_LINE` bytes without a newline are one line."""
        *whole, self._begun = (self._begun + data).split(b"\n")
        yield from whole
        if len(self._begun) > MAX_LINE:
            noise, self._begun = self._begun, b""
            yield noise[:_KEPT_OF_NOISE] + b"\xff"  # never taken for text

    @property
    def unfinished(self) -> bytes:
        """What has arrived of the next line."""
        return self._begun
