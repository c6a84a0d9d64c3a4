"""A vehicle of a few lines behind a real pseudo-terminal, which does what a test tells it to."""

from __future__ import annotations

import os
import pty
import select
import threading
import tty
from binascii import crc_hqx
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Self

HELLO = "V agvbench 2 1 us 0123abcd"


def with_checksum(text: str) -> bytes:
    return f"{text}*{crc_hqx(text.encode(), 0):04X}\n".encode()


class ScriptedVehicle:
    """Answers every line by `answer`, in a thread; remembers the lines.

    `answer` takes the text of a line without its checksum, and returns bytes to send.
    """

    def __init__(self, answer: Callable[[str], bytes] | None = None) -> None:
        self.lines: list[str] = []
        self.heard = threading.Condition()
        self._answer = answer or self.obey
        self._near, self._far = pty.openpty()
        tty.setraw(self._far)
        self.port = os.ttyname(self._far)
        self._pulled = threading.Event()
        self._thread = threading.Thread(target=self._serve)

    @staticmethod
    def obey(text: str) -> bytes:
        if text == "V":
            return with_checksum(HELLO)
        return with_checksum(f"ok {text.split()[1]}") if text.startswith("S ") else b""

    def set_command(self, data: bytes) -> None:
        os.write(self._near, data)

    def unplug(self) -> None:
        """Take both ends away, as a cable that is pulled does."""
        self._pulled.set()
        if self._thread.ident is not None:
            self._thread.join(5.0)
        for end in (self._near, self._far):
            with suppress(OSError):
                os.close(end)

    def wait_for(self, text: str) -> bool:
        """Wait until a line contains `text`."""
        with self.heard:
            return self.heard.wait_for(lambda: any(text in line for line in self.lines), timeout=10.0)

    def _serve(self) -> None:
        begun = b""
        while not self._pulled.is_set():
            if not select.select([self._near], [], [], 0.01)[0]:
                continue
            *whole, begun = (begun + os.read(self._near, 256)).split(b"\n")
            for line in whole:
                text = line.decode("latin-1").partition("*")[0]
                with self.heard:
                    self.lines.append(text)
                    self.heard.notify_all()
                if answer := self._answer(text):
                    os.write(self._near, answer)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.unplug()
