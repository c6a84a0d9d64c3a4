"""Same seed, same bytes: in process, over TCP, and with every adapter in a process of its own."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest

PROGRAM = "import sys; from agvbench.cli import main; sys.exit(main())"
SEED = "--seed=5"


def command(*arguments):
    return [sys.executable, "-c", PROGRAM, *arguments]


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextmanager
def running(*arguments):
    """An adapter as its own process, ended by the signal that a service manager sends."""
    process = subprocess.Popen(command(*arguments), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        yield process
        process.send_signal(signal.SIGTERM)
        output, _ = process.communicate(timeout=20)
        assert process.returncode == 0, output
        assert "Traceback" not in output
    finally:
        process.kill()
        process.wait()


def listening(port, *, within_s=60.0):
    deadline = time.monotonic() + within_s
    while time.monotonic() < deadline:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    raise AssertionError(f"nothing listens on port {port}")


def bench(directory, *more):
    options = ["--repeats=1", SEED, "--no-report", f"--out={directory}", "-k", "5-un or 5-cal or r05", *more]
    done = subprocess.run(
        command("bench", "trajectories", "step_response", "--calibration", vehicle(), *options),
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    tables = {}
    for table in ("runs", "commands", "poses"):
        for path in sorted((directory / f"{table}.parquet").iterdir()):
            tables[f"{table}/{path.name}"] = path.read_bytes()
    assert len(tables) >= 6
    return tables


def vehicle():
    from agvbench.model import example_path

    return str(example_path("thesis"))


@pytest.fixture(scope="module")
def in_process(tmp_path_factory):
    return bench(tmp_path_factory.mktemp("in_process") / "campaign")


def test_again_in_process(in_process, tmp_path):
    assert bench(tmp_path / "campaign") == in_process


@pytest.mark.slow
def test_told_for_longer_at_a_time(in_process, tmp_path):
    assert bench(tmp_path / "campaign", "--exchange=2") == in_process


def test_another_seed_differs(in_process, tmp_path):
    other = bench(tmp_path / "campaign", "--seed=6")
    assert other.keys() == in_process.keys()
    assert all(other[name] != data for name, data in in_process.items() if name.startswith("poses"))


@pytest.mark.real_time
def test_simulator_in_a_process_of_its_own_over_tcp(in_process, tmp_path):
    endpoint = f"tcp/127.0.0.1:{(port := free_port())}"
    with running("sim", "--listen", endpoint, SEED):
        listening(port)
        assert bench(tmp_path / "campaign", "--connect", endpoint) == in_process


@pytest.mark.real_time
@pytest.mark.slow
def test_vehicle_and_camera_in_processes_of_their_own(in_process, tmp_path):
    endpoint = f"tcp/127.0.0.1:{(port := free_port())}"
    with running("agv", "sim", "--listen", endpoint, SEED):
        listening(port)
        camera = f"tcp/127.0.0.1:{(camera_port := free_port())}"
        with running("mocap", "sim", "--connect", endpoint, "--listen", camera, SEED):
            listening(camera_port)
            assert bench(tmp_path / "campaign", "--connect", endpoint) == in_process


@pytest.mark.real_time
def test_a_simulator_with_another_seed_is_refused(tmp_path):
    endpoint = f"tcp/127.0.0.1:{(port := free_port())}"
    with running("sim", "--listen", endpoint, "--seed=99"):
        listening(port)
        options = ["--connect", endpoint, SEED, "--out", str(tmp_path / "campaign"), "--calibration", vehicle()]
        done = subprocess.run(
            command("bench", "trajectories", *options), capture_output=True, text=True, check=False, timeout=100
        )
    assert done.returncode == 2
    assert "the simulated agv runs with another seed: 99 (limit: 5)" in done.stdout + done.stderr
