"""A session pauses between runs for a file or Ctrl-Z, the vehicle at neutral, and goes on as if nothing had been."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from agvbench.campaign import Campaign
from agvbench.running.execution.pause import PAUSE_FILE, PauseRequest
from agvbench.running.session.opening import open_session
from agvbench.running.session.session import BenchSession

pytestmark = pytest.mark.real_time

OPTIONS = {"vehicle": "", "seed": 2}


@contextmanager
def session(path: Path, told: list[str]) -> Iterator[BenchSession]:
    with open_session(OPTIONS, out=str(path), resume=False, dry_run=False, on_progress=told.append) as opened:
        yield opened


def drive(opened: BenchSession, name: str) -> None:
    opened.driver(name, experiment="free", repeat=1).hold(for_s=0.5, drive=0.5)


@pytest.fixture
def told() -> list[str]:
    return []


@contextmanager
def once_paused(told: list[str], act: Callable[[], object]) -> Iterator[None]:
    """Within the context, act as soon as a session has said that it is paused."""
    over = threading.Event()

    def wait() -> None:
        while not over.wait(0.01):
            if any(line.startswith("paused ") for line in told):
                time.sleep(0.1)  # the pause itself takes a while, as a person's would
                act()
                return

    thread = threading.Thread(target=wait)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def test_a_file_pauses_and_its_absence_goes_on(tmp_path: Path, told: list[str]) -> None:
    path = tmp_path / "campaign"
    with session(path, told) as opened:
        drive(opened, "one")
        (path / PAUSE_FILE).touch()
        with once_paused(told, (path / PAUSE_FILE).unlink):
            drive(opened, "two")
    assert told[0].startswith("paused before two, the vehicle at neutral: press Ctrl-Z or remove ")
    assert told[1:] == ["going on"]
    undisturbed = tmp_path / "undisturbed"
    with session(undisturbed, []) as opened:
        drive(opened, "one")
        drive(opened, "two")
    for paused, other in zip(Campaign.open(path), Campaign.open(undisturbed), strict=True):
        assert np.array_equal(paused.frames.x_m, other.frames.x_m, equal_nan=True)
        assert paused.started_s == other.started_s


def test_ctrl_z_pauses_and_again_goes_on(tmp_path: Path, told: list[str]) -> None:
    path = tmp_path / "campaign"
    before = signal.getsignal(signal.SIGTSTP)
    with session(path, told) as opened:
        signal.raise_signal(signal.SIGTSTP)
        assert (path / PAUSE_FILE).exists()
        with once_paused(told, partial(os.kill, os.getpid(), signal.SIGTSTP)):
            drive(opened, "one")
    assert signal.getsignal(signal.SIGTSTP) is before
    assert [line.partition(" ")[0] for line in told] == ["pausing", "paused", "going"]
    assert Campaign.open(path).run_ids == ["one"]


def test_fg_goes_on_after_ctrl_z_but_ends_nobody_elses_pause(tmp_path: Path) -> None:
    pause = PauseRequest(tmp_path, lambda _: None)
    with pause.by_signal():
        signal.raise_signal(signal.SIGTSTP)
        signal.raise_signal(signal.SIGCONT)
        assert not pause.is_requested()
        (tmp_path / PAUSE_FILE).touch()
        signal.raise_signal(signal.SIGCONT)
        assert pause.is_requested()


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Hear Ctrl-C though whatever started the tests, in the background of a shell, has them ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_ends_a_pause(tmp_path: Path, told: list[str]) -> None:
    path = tmp_path / "campaign"

    def pause_and_interrupt() -> None:
        with session(path, told) as opened:
            (path / PAUSE_FILE).touch()
            with once_paused(told, partial(os.kill, os.getpid(), signal.SIGINT)):
                drive(opened, "one")

    with pytest.raises(KeyboardInterrupt):
        pause_and_interrupt()
    assert len(told) == 1
    assert not list((path / "runs.parquet").iterdir())
