"""A bench's end of the live view: it starts the process that streams, and never waits for it while it drives."""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import IO, TYPE_CHECKING

from agvbench.errors import FlagError, LinkError

if TYPE_CHECKING:
    from agvbench.bus.messages.runner_state import RunnerState

_PERIOD_S = 0.1
_END_LIMIT_S = 15.0
_URL = re.compile(r"rerun\+https?://(?P<host>\[[^\]]+\]|[^\s/:\[\]]+):(?P<port>[0-9]{1,5})/proxy")
_DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")
_ELSEWHERE = "start rerun on a machine with a display and name it with --viewer URL, or use agvbench watch"


def viewer_command(port: int) -> list[str]:
    """Return the command of a new viewer, which listens on loopback alone: by default it would on every interface."""
    beside = Path(sys.executable).with_name("rerun")
    program = str(beside) if beside.exists() else shutil.which("rerun") or "rerun"
    return [program, "--bind", "127.0.0.1", "--port", str(port), "--expect-data-soon"]


def require_viewer(url: str | None) -> None:
    """Refuse a live view that cannot be seen, before anything is driven.

    Raises
    ------
    FlagError
        If there is no display for a new viewer, no viewer program, or `url` is none of a viewer.
    LinkError
        If nothing listens at `url`.
    """
    if url:
        _require_listener(url)
    elif not any(os.environ.get(name) for name in _DISPLAYS):
        raise FlagError("no display for the viewer", where="--live", remedy=_ELSEWHERE)
    elif shutil.which(viewer_command(0)[0]) is None:
        raise FlagError("no viewer program", where="--live", value="rerun", remedy="pip install rerun-sdk")


def _require_listener(url: str) -> None:
    match = _URL.fullmatch(url)
    if match is None or not 0 < int(match["port"]) < 65536:
        limit = "rerun+http://HOST:PORT/proxy, for example rerun+http://127.0.0.1:9876/proxy"
        raise FlagError("not the address of a viewer", where="--viewer", value=repr(url), limit=limit)
    try:
        socket.create_connection((match["host"].strip("[]"), int(match["port"])), timeout=2.0).close()
    except OSError as error:
        remedy = "start there: rerun --bind 127.0.0.1, or correct the address"
        raise LinkError("no viewer", where=f"--viewer {url}", value=error.strerror or error, remedy=remedy) from None


class LiveView:
    """Streams the campaign in `directory` to the viewer at `url`, or to a new one.

    ``state`` gives the states of a runner in real time; a simulation is followed by its finished runs alone.
    """

    def __init__(
        self,
        directory: Path,
        url: str,
        on_progress: Callable[[str], None],
        state: Callable[[int, int], RunnerState] | None = None,
    ) -> None:
        self._on_progress, self._ended = on_progress, threading.Event()
        command = [sys.executable, "-m", "agvbench.reporting.viewer.streamer", str(directory), url]
        self._process: subprocess.Popen[bytes] | None = subprocess.Popen(  # noqa: S603
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            bufsize=0,  # a buffer would be locked by a thread that waits in it
            start_new_session=True,  # Ctrl-C ends the bench, whose last run is still to be sent
        )
        self.pid = self._process.pid
        self._thread: threading.Thread | None = None
        if state is not None:
            arguments = (self._process.stdin, state)
            self._thread = threading.Thread(target=self._send_states, args=arguments, name="agvbench-live", daemon=True)
            self._thread.start()

    def _send_states(self, pipe: IO[bytes], state: Callable[[int, int], RunnerState]) -> None:
        """Write states to the other process; where it takes none, this thread waits, and no other."""
        from agvbench.bus.messages.codec import encode

        with suppress(OSError):  # it has ended
            for number in count(1):
                if self._ended.wait(_PERIOD_S):
                    return
                payload = encode(state(number, 0))
                left = memoryview(len(payload).to_bytes(4, "little") + payload)
                while left:
                    left = left[pipe.write(left) :]

    def check(self) -> None:
        """Say once, in a line, if the live view has ended; never waits."""
        if self._process is not None and self._process.poll() is not None:
            self._finish(self._process)

    def close(self) -> None:
        """Let what is recorded be sent, for some seconds at most."""
        if (process := self._process) is None:
            return
        self._ended.set()
        if self._thread is not None:
            self._thread.join(1.0)
            if self._thread.is_alive():  # the process takes no states: it hangs
                process.kill()
                self._thread.join()
        if process.stdin is not None:
            process.stdin.close()
        try:
            process.wait(_END_LIMIT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        self._finish(process)

    def _finish(self, process: subprocess.Popen[bytes]) -> None:
        """Say why a process that has ended did so before its time, if it did; release what it held."""
        self._process = None
        self._ended.set()
        said = b"" if process.stdout is None else process.stdout.read()
        if process.returncode != 0:
            why = said.decode(errors="replace").strip() or f"its process has ended (exit code {process.returncode})"
            self._on_progress(f"no live view any more: {why}; the bench continues without it")
        self._close_pipes(process)

    def _close_pipes(self, process: subprocess.Popen[bytes]) -> None:
        """Close what is left of a process that has ended."""
        if self._thread is not None:
            self._thread.join()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                pipe.close()


@contextmanager
def live_view(
    directory: Path,
    url: str | None,
    on_progress: Callable[[str], None],
    state: Callable[[int, int], RunnerState] | None = None,
) -> Iterator[LiveView]:
    """Open a live view while the context lasts."""
    view = LiveView(directory, url or "", on_progress, state)
    try:
        yield view
    finally:
        view.close()
