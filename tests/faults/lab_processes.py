"""The adapters of a lab, and its runner, each in a process of its own: to kill them."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from live_lab import LiveLab

_PROGRAM = "from agvbench.cli import main; raise SystemExit(main())"


class Processes:
    """The two adapters' processes, and where they listen."""

    def __init__(self, lab: LiveLab) -> None:
        self.endpoints = [_free_endpoint(), _free_endpoint()]
        _, port = lab.server.address
        self.agv = _starting("agv", f"serial:{lab.host.port}", "--listen", self.endpoints[0])
        self.mocap = _starting("mocap", f"natnet:127.0.0.1:{port}", "--listen", self.endpoints[1])
        for process in (self.agv, self.mocap):
            assert process.stdout is not None
            ready = process.stdout.readline()
            assert ready.startswith("ready: "), process.communicate()

    def close(self) -> None:
        """End what is left."""
        for process in (self.agv, self.mocap):
            process.kill()
            process.communicate()


def _free_endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def _starting(*arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", _PROGRAM, *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@contextmanager
def processes(lab: LiveLab) -> Iterator[Processes]:
    """Run the adapters of `lab` while the context lasts."""
    running = Processes(lab)
    try:
        yield running
    finally:
        running.close()


@contextmanager
def runner(endpoints: list[str]) -> Iterator[subprocess.Popen[str]]:
    """Drive straight on from a process of its own; it says so when it begins."""
    with _script("drive_on.py", endpoints, "driving\n") as process:
        time.sleep(0.5)
        yield process


@contextmanager
def slow_consumer(endpoints: list[str]) -> Iterator[subprocess.Popen[str]]:
    """Let a process listen to everything, and never take it."""
    with _script("never_take.py", endpoints, "listening\n") as process:
        yield process


@contextmanager
def _script(name: str, endpoints: list[str], ready: str) -> Iterator[subprocess.Popen[str]]:
    script = Path(__file__).with_name(name)
    process = subprocess.Popen([sys.executable, str(script), *endpoints], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == ready
        yield process
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.communicate()
