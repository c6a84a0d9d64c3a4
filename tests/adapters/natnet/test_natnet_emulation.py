"""``agvbench mocap --emulate`` as a process: our client sees a vehicle drive, and Ctrl-C ends it."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from agvbench.adapters.natnet.axes import to_floor
from agvbench.adapters.natnet.channel import Connection
from agvbench.adapters.natnet.client import Client, Seen
from agvbench.bus.clock import WallClock
from agvbench.cli import main

pytestmark = pytest.mark.real_time


def test_a_vehicle_is_seen_to_drive() -> None:
    program = "import sys; from agvbench.cli import main; sys.exit(main())"
    command = [
        sys.executable,
        "-c",
        program,
        "mocap",
        "--emulate",
        "--port=0",
        "--natnet-version=3.1",
        "--vehicle-name=blue",
    ]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    ready = process.stdout.readline()
    port = re.fullmatch(r"ready: NatNet 3.1 at 127.0.0.1:(\d+), streaming in unicast; stop with Ctrl-C\n", ready)
    assert port, ready
    seen: list[Seen] = []
    client = Client(Connection("127.0.0.1", int(port[1])), WallClock(), seen.append)
    client.start()
    deadline = time.monotonic() + 20.0
    while len(seen) < 120 and time.monotonic() < deadline:
        time.sleep(0.05)
    client.close()
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=20)[0] == "stopped\n"
    assert process.returncode == 0
    assert client.names == {"blue": 1}
    bodies = np.concatenate([one.frame.bodies for one in seen])
    poses = to_floor(bodies["position_m"], bodies["quaternion"], "y")
    assert np.nanmax(np.abs(poses[:, 2] - poses[0, 2])) > 0.05
    assert np.hypot(*(poses[-1, :2] - poses[0, :2])) > 0.05


def test_what_cannot_be_emulated_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["mocap", "--emulate", "--natnet-version", "1.0"]) == 2
    assert "NatNet version is not supported: 1.0 (limit: 2.5 to 4.2)" in capsys.readouterr().err
    assert main(["mocap", "--emulate", "--port", "70000"]) == 2
    assert "address cannot be used" in capsys.readouterr().err
