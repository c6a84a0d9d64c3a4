"""What the vehicle hears: the firmware's own reader of lines, built for this machine.

Undefined behaviour ends the process. The first byte of an input chooses the version of the firmware.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path

from fuzz.target import Target

_ROOT = Path(__file__).parents[2]
_HOST, _FIRMWARE = _ROOT / "fuzz/host", _ROOT / "firmware/src"


class FirmwareLine(Target):
    """A version and bytes from the line."""

    name = "firmware_line"
    instruments = ("agvbench.adapters.serial_line", "fuzz.targets.firmware_line")
    longest = 512

    def __init__(self) -> None:
        from agvbench.adapters.serial_line.lines import decode_line
        from agvbench.adapters.serial_line.replies import Accepted, parse_reply

        self._decode, self._parse, self._accepted = decode_line, parse_reply, Accepted
        self._folder = tempfile.TemporaryDirectory()
        self._versions = [_built(version, Path(self._folder.name)) for version in (1, 2)]

    @classmethod
    def missing(cls) -> str:
        """Say what is needed and not there."""
        return "" if shutil.which("gcc") else "gcc builds the firmware's protocol for this machine"

    def seeds(self) -> Iterable[bytes]:
        """Return lines that both versions take, and some that they refuse."""
        from agvbench.adapters.serial_line.lines import encode_line

        lines = ("V", "S 1 90 90 90", "S 2 30 150 90", "S 1 1700 1500 1500", "M 1 1700 1500 1500 200", "Q", "X")
        for version in (0, 1):
            for line in lines:
                for checksum in (False, True):
                    yield bytes([version]) + encode_line(line, checksum=checksum) * 3

    def feed(self, data: bytes) -> None:
        """Every line is answered by one, and nothing moves but by a command that is accepted, within its range."""
        version, heard = data[0] % 2 if data else 0, data[1:]
        answers, results = ctypes.POINTER(ctypes.c_uint8)(), (ctypes.c_uint * 3)()
        size = self._versions[version](heard, len(heard), ctypes.byref(answers), results)
        said = ctypes.string_at(answers, size)
        assert said.count(b"\n") == heard.count(b"\n")
        accepted = 0
        for line in said.split(b"\n")[:-1]:
            text = self._decode(line, checksum=False)
            assert text is not None, line
            reply = self._parse(text)
            assert reply is not None, line
            accepted += isinstance(reply, self._accepted)
        held, queued, wild = results
        assert (accepted, wild) == (held + queued, 0)


def _built(version: int, folder: Path) -> ctypes._NamedFuncPointer:
    library = folder / f"version{version}.so"
    subprocess.run(  # noqa: S603  (nothing of it comes from outside)
        [  # noqa: S607
            "gcc", "-shared", "-fPIC", "-O1", "-std=c99", "-fsanitize=undefined", "-fsanitize-undefined-trap-on-error",
            f"-DVERSION={version}", f"-I{_HOST}", f"-I{_FIRMWARE}", "-include", str(_FIRMWARE / "calibration.h"),
            str(_HOST / "firmware_lines.c"), "-o", str(library),
        ],
        check=True,
    )  # fmt: skip
    feed = ctypes.CDLL(str(library)).feed
    feed.restype = ctypes.c_size_t
    feed.argtypes = [ctypes.c_char_p, ctypes.c_size_t, ctypes.c_void_p, ctypes.c_void_p]
    return feed
