"""The live view of a bench: a real session, its streaming process, and a Rerun server that keeps what arrives."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agvbench.bus.messages.codec import encode
from agvbench.bus.messages.runner_state import Phase, RunnerState, RunResult
from agvbench.campaign import Campaign
from agvbench.reporting.viewer.process import LiveView, live_view, viewer_command
from agvbench.reporting.viewer.streamer import StateInput, stream
from agvbench.running.session.opening import open_session
from agvbench.running.session.session import BenchSession
from agvbench.types import Command, Pose

pytestmark = pytest.mark.real_time
BENCH = [
    sys.executable, "-c", "import sys; from agvbench.cli import main; sys.exit(main())", "bench", "trajectories",
    "-k", "uncalibrated", "--trajectories", "5,7", "--repeats", "1", "--no-report",
]  # fmt: skip


@pytest.fixture
def port(free_port: Callable[[], int]) -> int:
    return free_port()


def until(condition: Callable[[], bool], limit_s: float = 20.0) -> bool:
    end_s = time.monotonic() + limit_s
    while not condition() and time.monotonic() < end_s:
        time.sleep(0.05)
    return condition()


def accepts(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


class Sink:
    """A Rerun server without a window, which writes what it receives into a file."""

    def __init__(self, port: int, path: Path) -> None:
        self.url, self.path = f"rerun+http://127.0.0.1:{port}/proxy", path
        command = [*viewer_command(port), "--serve-grpc", "--save", str(path)]
        silent: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        # The program is started by a script: both are ended together.
        self.process = subprocess.Popen(command, start_new_session=True, **silent)
        assert until(lambda: accepts(port))

    def end(self) -> None:
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGTERM)
        self.process.wait(10)

    def columns(self) -> dict[str, list[dict[str, list[Any]]]]:
        """Return what arrived: by entity, its chunks as columns."""
        chunks = pytest.importorskip("rerun.chunk", reason="this Rerun SDK cannot read recordings")
        found: dict[str, list[dict[str, list[Any]]]] = {}
        for chunk in chunks.RrdReader(str(self.path)).stream().to_chunks():
            found.setdefault(str(chunk.entity_path), []).append(chunk.to_record_batch().to_pydict())
        return found


@contextmanager
def sink(port: int, path: Path) -> Iterator[Sink]:
    opened = Sink(port, path)
    try:
        yield opened
    finally:
        opened.end()


def refused(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    clean = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    command = [*BENCH, "--out", str(folder / "campaign"), *options]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60, env=clean)


@contextmanager
def session(path: Path) -> Iterator[BenchSession]:
    given = {"seed": 2, "exchange": 2.0}
    with open_session(given, out=str(path), resume=False, dry_run=False, on_progress=lambda _: None) as opened:
        yield opened


def drive(opened: BenchSession, name: str, trajectory: str = "5") -> None:
    opened.driver(name, experiment="trajectory", repeat=1).trajectory(trajectory, condition="uncalibrated")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a campaign of two runs."""
    path = tmp_path_factory.mktemp("live") / "campaign"
    with session(path) as opened:
        drive(opened, "one")
        drive(opened, "two", "7")
    return path


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_a_simulation_arrives_run_by_run(port: int, recorded: Path, tmp_path: Path) -> None:
    messages: list[str] = []
    with sink(port, tmp_path / "sink.rrd") as server, live_view(recorded, server.url, messages.append):
        pass  # what is recorded by its end is sent
    assert messages == []
    arrived = server.columns()
    assert "/floor/workspace" in arrived
    for run in Campaign.open(recorded):
        entity = f"/runs/{run.trajectory}/uncalibrated/{run.run_id}"
        found = {name.removeprefix(f"{entity}/") for name in arrived if name.startswith(f"{entity}/")}
        assert found == {"path", "plan", "target", "vehicle", "commands", "residual"}
        (commands,) = (columns for columns in arrived[f"{entity}/commands"] if "run_time" in columns)
        sent = np.array(commands["Scalars:scalars"])
        for name, column in zip(Command._fields, sent.T, strict=True):
            # Steps: every command twice, at its own time and when the next one replaces it.
            assert column.tolist() == np.repeat(getattr(run.commands, name), 2).tolist()
        (residual,) = (columns for columns in arrived[f"{entity}/residual"] if "progress_mm" in columns)
        assert len(residual["progress_mm"]) > 100
        (planned,) = arrived[f"{entity}/plan"][0]["LineStrips3D:strips"][0]
        (driven,) = arrived[f"{entity}/path"][0]["LineStrips3D:strips"][0]
        assert planned[0][:2] == pytest.approx(driven[0][:2], abs=0.01)


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_a_vehicle_in_real_time_is_shown_while_it_drives(port: int, recorded: Path, tmp_path: Path) -> None:
    read, write = os.pipe()
    with sink(port, tmp_path / "sink.rrd") as server, os.fdopen(read, "rb") as states:
        given = (recorded, server.url, StateInput(states))
        streaming = threading.Thread(target=stream, args=given)
        streaming.start()
        for number in range(1, 31):
            command = Command(1500.0 + 100.0 * (number // 15), 1500.0, 1500.0)
            state = RunnerState(
                number, 7, "campaign", "1.0", Phase.DRIVING, 0.0, 0.2 * number, pose=Pose(0.01 * number, 0.0, 0.1),
                command=command, faults=("agv commands_late: 0.3 s",), fault_count=1,
            )  # fmt: skip
            payload = encode(state)
            os.write(write, len(payload).to_bytes(4, "little") + payload)
            time.sleep(0.2)
        os.close(write)
        streaming.join(30.0)
        assert not streaming.is_alive()
    arrived = server.columns()
    assert sum(len(columns.get("Transform3D:translation", [])) for columns in arrived["/live/vehicle"]) > 5
    (faults,) = [line for columns in arrived["/faults/live"] for line in columns["TextLog:text"]]
    assert faults == ["agv commands_late: 0.3 s"]
    held = sorted(
        (at.total_seconds(), values[0])
        for columns in arrived["/live/command"]
        if "session_time" in columns
        for at, values in zip(columns["session_time"], columns["Scalars:scalars"], strict=True)
    )
    # A step: between two different commands there is no time in which a line could rise.
    rises = [after[0] - before[0] for before, after in pairwise(held) if before[1] != after[1]]
    assert rises
    assert max(rises) < 1e-4


def test_a_viewer_that_dies_stops_nothing(port: int, tmp_path: Path) -> None:
    messages: list[str] = []
    path = tmp_path / "campaign"
    with sink(port, tmp_path / "sink.rrd") as server, session(path) as opened:
        drive(opened, "one")
        with live_view(path, server.url, messages.append) as view:
            size = server.path.stat().st_size
            assert until(lambda: server.path.stat().st_size > size + 20_000, 60.0), "the first run has arrived"
            server.end()
            drive(opened, "two")
            checked_s = time.monotonic()
            view.check()
            assert time.monotonic() - checked_s < 0.5
            assert until(lambda: view.check() or bool(messages), 60.0)
        drive(opened, "three")
    assert len(Campaign.open(path)) == 3
    (line,) = messages
    assert re.fullmatch(r"no live view any more: the Rerun viewer does not answer .*; the bench continues .*", line)


@pytest.mark.slow
def test_a_window_that_cannot_open_is_one_line(recorded: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":77")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    messages: list[str] = []
    with live_view(recorded, None, messages.append) as view:
        assert until(lambda: view.check() or bool(messages), 60.0)
    reason = "the Rerun viewer has failed (exit code 1); start rerun to see why"
    assert messages == [f"no live view any more: {reason}; the bench continues without it"]


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (("--live",), "--live: no display for the viewer; start rerun on a machine with a display and name it with"),
        (("--viewer", "http://x"), "--viewer: not the address of a viewer: 'http://x' (limit: rerun+http://HOST:PORT/"),
        (("--viewer", "rerun+http://127.0.0.1:9/proxy"), "127.0.0.1:9/proxy: no viewer: Connection refused; start"),
    ],
)
def test_a_live_view_that_cannot_be_seen_is_refused_before_anything_is_driven(
    options: tuple[str, ...], line: str, tmp_path: Path
) -> None:
    done = refused(tmp_path, *options)
    assert done.returncode == 2
    assert line in done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    assert not (tmp_path / "campaign").exists()


def test_a_viewer_listens_on_loopback_alone(port: int, tmp_path: Path) -> None:
    with sink(port, tmp_path / "sink.rrd"):
        rows = [line.split() for name in ("tcp", "tcp6") for line in Path(f"/proc/net/{name}").read_text().splitlines()]
        listening = [row[1] for row in rows if row[3] == "0A" and row[1].endswith(f":{port:04X}")]
    assert listening == [f"0100007F:{port:04X}"]


def test_a_process_that_hangs_holds_nobody_up(port: int, recorded: Path, tmp_path: Path) -> None:
    """It is suspended, and takes no states: the thread that sends waits, the session's end does not."""
    large = ("x" * 400,) * 8

    def state(number: int, source: int) -> RunnerState:
        results = (RunResult("x" * 200, "x" * 400),) * 8
        return RunnerState(
            number, source, "x", "1.0", Phase.DRIVING, 0.0, 1.0, faults=large, fault_count=8, results=results
        )

    messages: list[str] = []
    with sink(port, tmp_path / "sink.rrd") as server:
        view = LiveView(recorded, server.url, messages.append, state)
        try:
            os.kill(view.pid, signal.SIGSTOP)
            time.sleep(2.0)  # more states than a pipe of 64 kB holds
            began_s = time.monotonic()
            view.check()
            assert time.monotonic() - began_s < 0.5
        finally:
            began_s = time.monotonic()
            view.close()
        assert time.monotonic() - began_s < 5.0
    assert messages == ["no live view any more: its process has ended (exit code -9); the bench continues without it"]
