"""``agvbench watch`` beside a real session, each in a process of its own, over loopback."""

from __future__ import annotations

import json
import os
import pty
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from agvbench.adapters import AdapterOptions, host_adapters
from agvbench.bus.session import bus_session
from agvbench.campaign import Campaign
from agvbench.errors import FlagError, LinkError
from agvbench.running.execution.pause import PAUSE_FILE
from agvbench.running.session.driver import RunRejectedError
from agvbench.running.session.opening import open_session
from agvbench.running.session.session import BenchSession
from agvbench.statistics import run_error
from agvbench.workflows.watch import watched_states

pytestmark = pytest.mark.real_time
RUNS = ("one", "two", "three")
COMMAND = [sys.executable, "-c", "import sys; from agvbench.cli import main; sys.exit(main())", "watch"]


@pytest.fixture
def endpoint(free_port: Callable[[], int]) -> str:
    return f"tcp/127.0.0.1:{free_port()}"


@contextmanager
def session(path: Path, listen: str | None, **options: Any) -> Iterator[BenchSession]:
    given = {"seed": 2, "exchange": 2.0, **options}
    opening = open_session(given, out=str(path), resume=False, dry_run=False, on_progress=lambda _: None, listen=listen)
    with opening as opened:
        opened.expect(RUNS, [])
        yield opened


def drive(opened: BenchSession, name: str) -> None:
    opened.driver(name, experiment="trajectory", repeat=1).trajectory("5", condition="uncalibrated")


def watch(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, check=False, timeout=60)


@contextmanager
def watching(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen([*COMMAND, "--wait=60", *arguments], text=True, bufsize=1, **streams) as process:
        try:
            yield process
        finally:
            process.kill()


def next_line(process: subprocess.Popen[str], pattern: str) -> str:
    """Return the next line that has `pattern`; the end of the output is an error."""
    assert process.stdout is not None
    return next(line for line in process.stdout if re.search(pattern, line))


def test_a_late_observer_sees_what_was_driven_before(tmp_path: Path, endpoint: str) -> None:
    with session(tmp_path / "monday", endpoint) as opened:
        drive(opened, "one")
        drive(opened, "two")
        done = watch("--connect", endpoint, "--once", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    (line,) = done.stdout.splitlines()
    state = json.loads(line)
    assert (state["lab"], state["vehicle"], state["campaign"], state["counted"]) == ("lab", "agv1", "monday", 2)
    assert (state["run"]["number"], state["run"]["of"], state["run"]["run_id"]) == (2, 3, "two")
    assert state["pose"].keys() == {"x_m", "y_m", "heading_rad"}
    assert state["command"] is not None
    shown = [(r["run_id"], r["position_mm"], r["heading_deg"]) for r in state["results"]]
    recorded = [(run.run_id, run_error(run)) for run in Campaign.open(tmp_path / "monday")]
    assert shown == [(name, error.position_mm, error.heading_deg) for name, error in recorded]


def test_once_prints_the_state_and_leaves(tmp_path: Path, endpoint: str) -> None:
    with session(tmp_path / "monday", endpoint) as opened:
        drive(opened, "one")
        done = watch("--connect", endpoint, "--once")
    assert (done.returncode, done.stderr) == (0, "")
    assert re.search(r"^bench +monday, lab/agv1, agvbench \d", done.stdout)
    assert re.search(r"^run +1 of 3: one, trajectory 5, uncalibrated, repeat 1", done.stdout, re.MULTILINE)
    assert re.search(r"^one +\d+\.\d mm +[+-]\d+\.\d\d°", done.stdout, re.MULTILINE)


def test_lines_say_what_changes_and_at_last_how_it_ended(tmp_path: Path, endpoint: str) -> None:
    with watching("--connect", endpoint) as process:
        with session(tmp_path / "monday", endpoint) as opened:
            next_line(process, "watching monday of lab/agv1, agvbench")
            for name in RUNS:
                drive(opened, name)
                next_line(process, f"{name}: ok, end position error .* mm, heading error .*°")
        assert next_line(process, "the bench").endswith("the bench has finished: 3 runs counted, 0 rejected\n")
        assert process.wait(20) == 0


def test_json_lines_end_with_the_bench_and_say_why_it_was_stopped(tmp_path: Path, endpoint: str) -> None:
    states = []
    with watching("--connect", endpoint, "--json") as process:
        with suppress(KeyboardInterrupt), session(tmp_path / "monday", endpoint) as opened:
            states.append(json.loads(next_line(process, "{")))
            drive(opened, "one")
            raise KeyboardInterrupt
        assert process.stdout is not None
        states += map(json.loads, process.stdout)
        assert process.wait(20) == 0
    numbers = [state["sequence"] for state in states]
    assert numbers == sorted(set(numbers))
    assert (states[-1]["phase"], states[-1]["failure"], states[-1]["counted"]) == ("finished", "ended by Ctrl-C", 1)


def test_a_pause_is_seen(tmp_path: Path, endpoint: str) -> None:
    path = tmp_path / "monday"
    with watching("--connect", endpoint) as process, session(path, endpoint) as opened:
        next_line(process, "watching")
        (path / PAUSE_FILE).touch()
        seen: list[str] = []

        def go_on_when_seen() -> None:
            seen.append(next_line(process, "pausing: run 1 of 3, one"))
            (path / PAUSE_FILE).unlink()

        observer = threading.Thread(target=go_on_when_seen)
        observer.start()
        drive(opened, "one")
        observer.join()
        assert len(seen) == 1


def test_a_rejected_run_is_a_fault(tmp_path: Path, endpoint: str) -> None:
    with session(tmp_path / "monday", endpoint, camera="lost=0.4", attempts=1) as opened:
        with pytest.raises(RunRejectedError):
            drive(opened, "one")
        done = watch("--connect", endpoint, "--once", "--json")
    state = json.loads(done.stdout)
    assert (state["counted"], state["rejected"], state["fault_count"]) == (0, 1, 1)
    assert re.match("one: rejected: .*", state["faults"][0])


def test_the_view_at_a_terminal_is_drawn_in_place_and_ctrl_c_leaves_the_bench_alone(
    tmp_path: Path, endpoint: str
) -> None:
    with session(tmp_path / "monday", endpoint) as opened:
        drive(opened, "one")
        primary, secondary = pty.openpty()
        environment = os.environ | {"TERM": "xterm-256color", "COLUMNS": "100", "LINES": "30"}
        before = signal.signal(signal.SIGINT, signal.default_int_handler)  # in the background it may be ignored
        process = subprocess.Popen(
            [*COMMAND, "--connect", endpoint], stdin=secondary, stdout=secondary, stderr=secondary, env=environment
        )
        signal.signal(signal.SIGINT, before)
        os.close(secondary)
        shown = _read_until(primary, b"last runs")
        drive(opened, "two")
        shown += _read_until(primary, b"two")
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
        shown += _rest(primary)
        drive(opened, "three")
    assert "Traceback" not in shown.decode()
    assert "\x1b[1A" in shown.decode()  # the cursor goes up: the view replaces the one before
    assert len(Campaign.open(tmp_path / "monday")) == 3


def _read_until(terminal: int, text: bytes, limit_s: float = 30.0) -> bytes:
    read, end_s = b"", time.monotonic() + limit_s
    while text not in read:
        assert time.monotonic() < end_s, read
        read += os.read(terminal, 4096)
    return read


def _rest(terminal: int) -> bytes:
    read = b""
    with suppress(OSError):  # Linux says so at the end
        while part := os.read(terminal, 4096):
            read += part
    os.close(terminal)
    return read


@pytest.mark.parametrize("options", [(), ("--json",), ("--once",)])
def test_no_bench_is_one_line_and_exit_code_2(endpoint: str, options: tuple[str, ...]) -> None:
    done = watch("--connect", endpoint, "--wait", "0.3", *options)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        f"agvbench watch: connect {endpoint}: nothing listens: tried for 0.3 s; "
        f"start 'agvbench bench --listen {endpoint}' there, or correct the endpoint\n"
    )


def test_several_benches_are_listed(tmp_path: Path, endpoint: str) -> None:
    """Two benches on one bus: the second connects to the first, whose vehicle has another name."""
    with (
        session(tmp_path / "blue", endpoint, vehicle_name="blue"),
        _second_vehicle(endpoint),
        session(tmp_path / "red", None, vehicle_name="red", connect=endpoint),
    ):
        with pytest.raises(FlagError, match="several benches are running: lab/blue, lab/red; choose one"):
            watched_states(endpoint, once=True).__enter__()
        with watched_states(endpoint, vehicle="red", once=True) as watched:
            (state,) = watched.states
        assert state is not None
        assert (watched.name, state.campaign) == ("lab/red", "red")
        with pytest.raises(LinkError, match="no bench answers"), watched_states(endpoint, lab="hall", wait_s=0.3):
            pass


@contextmanager
def _second_vehicle(endpoint: str) -> Iterator[None]:
    options = AdapterOptions(vehicle="red", seed=2)
    with bus_session(connect=[endpoint]) as bus, host_adapters(bus, "lab", options, agv="sim", mocap="sim"):
        yield


def test_a_session_that_connects_does_not_listen(tmp_path: Path, endpoint: str) -> None:
    with pytest.raises(FlagError, match="--listen: a session that connects does not listen"):
        session(tmp_path / "monday", endpoint, connect="tcp/127.0.0.1:9").__enter__()


@pytest.mark.parametrize("value", ["0", "-1", "nan", "inf"])
def test_a_time_to_wait_that_cannot_be(value: str) -> None:
    with pytest.raises(FlagError, match="--wait: value cannot be used"):
        watched_states("tcp/127.0.0.1:9", wait_s=float(value)).__enter__()
