"""What the tests' workers run: functions of a module that a worker can import."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

from agvbench.errors import FitError
from agvbench.model.simulation.threads import thread_count


def square(number: float) -> float:
    return number * number


def fails(number: int) -> int:
    if number == 2:
        raise FitError("nothing to fit", where=f"number {number}")
    if number == 3:
        raise KeyError("number")
    return number


def process_id(_: int, wait_s: float = 0.0) -> int:
    time.sleep(wait_s)
    return os.getpid()


def logged(folder: str, number: int) -> int:
    """Leave a file for each time that it begins."""
    times = len(list(Path(folder).glob(f"{number}-*")))
    Path(folder, f"{number}-{times}").touch()
    time.sleep(0.05)
    return number


def dies(folder: str, number: int, times: int) -> int:
    """Kill the process `times` times; return how many times it was begun."""
    begun = len(list(Path(folder).glob(f"{number}-*")))
    Path(folder, f"{number}-{begun}").touch()
    if begun < times:
        os.kill(os.getpid(), signal.SIGKILL)
    return begun + 1


def text(_: int) -> str:
    return "no number"


def waits(folder: str, number: int) -> int:
    Path(folder, f"begun-{number}").touch()
    while not Path(folder, "go").exists():
        time.sleep(0.02)
    return number


def threads(_: int) -> int:
    return thread_count()
