"""The same frames in process, over TCP and from separate processes; and what happens when one vanishes."""

from __future__ import annotations

import os
import pty
import re
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from natnet_server import natnet_server
from rig_driving import HANGING, NEUTRAL, START, TINY, digest, drive_run, process

from agvbench.adapters import AdapterOptions, host_adapters, open_rig
from agvbench.adapters.frame_recorder import FrameRecorder
from agvbench.bus.clock import SimulatedClock
from agvbench.bus.link import VehicleLink
from agvbench.bus.messages.frames import FrameClock
from agvbench.bus.session import open_bus_session
from agvbench.errors import AdapterGoneError, LinkError
from agvbench.workflows.adapter_process import StreamStatus

pytestmark = pytest.mark.real_time

KEYS = ("a", "b")
PROGRAM = "from agvbench.cli import main; raise SystemExit(main())"
SEED = ("--seed", "11")


@pytest.fixture(scope="module")
def expected() -> list[str]:
    with open_rig(plant=TINY, seed=11) as link:
        return [digest(drive_run(link, key)) for key in KEYS]


@pytest.fixture
def endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def test_same_frames_over_tcp_between_two_sessions(expected: list[str], endpoint: str) -> None:
    options = AdapterOptions(plant=TINY, seed=11)
    with (
        open_bus_session(listen=[endpoint]) as session,
        host_adapters(session, "lab", options, agv="sim", mocap="sim"),
        open_rig(connect=endpoint, seed=11) as link,
    ):
        assert [digest(drive_run(link, key)) for key in KEYS] == expected
        assert link.loss.lost == 0


def test_same_frames_from_one_simulator_process(expected: list[str], endpoint: str) -> None:
    with process("sim", *SEED, "--plant", TINY, "--listen", endpoint), open_rig(connect=endpoint, seed=11) as link:
        assert [digest(drive_run(link, key)) for key in KEYS] == expected


def test_same_frames_from_a_vehicle_and_a_camera_process(expected: list[str], endpoint: str) -> None:
    with (
        process("agv", "sim", *SEED, "--plant", TINY, "--listen", endpoint),
        process("mocap", "sim", *SEED, "--connect", endpoint),
        open_rig(connect=endpoint, seed=11) as link,
    ):
        assert [digest(drive_run(link, key)) for key in KEYS] == expected


def test_a_camera_process_says_what_arrives(endpoint: str, tmp_path: Path) -> None:
    """With --verbose also where no terminal is; at a terminal every second."""
    with natnet_server() as spec:
        here, there = pty.openpty()
        command = [sys.executable, "-c", PROGRAM, "mocap", spec, "--listen", endpoint]
        child = subprocess.Popen(command, stdout=there, stderr=there)
        os.close(there)
        said = b""
        while b"heading" not in said and select.select([here], [], [], 30.0)[0]:
            said += os.read(here, 4096)
        child.send_signal(signal.SIGTERM)
        assert child.wait(20.0) == 0
        os.close(here)
    assert re.search(r"\d+\.\d frames/s, 100 % tracked, last pose x = 1.000 m, y = 2.000 m, heading", said.decode())


def test_the_status_of_a_stream_is_printed_when_it_is_due(capsys: pytest.CaptureFixture[str]) -> None:
    clock = SimulatedClock()
    recorder = FrameRecorder(clock)
    status = StreamStatus(recorder, clock, 10.0)
    recorder.frame(0.0, 1.0, 2.0, 0.0, clock=FrameClock.ADAPTER)
    status.print_if_due()
    clock.sleep(10.0)
    status.print_if_due()
    recorder.failed(LinkError("the cable is out"))
    clock.sleep(10.0)
    status.print_if_due()
    assert capsys.readouterr().out.splitlines() == [
        "0.1 frames/s, 100 % tracked, last pose x = 1.000 m, y = 2.000 m, heading 0.0°",
        "failed: the cable is out",
        "no frame for 10 s",
    ]


def killing(child: subprocess.Popen[str]) -> subprocess.Popen[bytes]:
    """Kill `child` while the next call waits for it."""
    program = f"import os, time; time.sleep(0.3); os.kill({child.pid}, {int(signal.SIGKILL)})"
    return subprocess.Popen([sys.executable, "-c", program])


def test_a_simulator_that_is_killed_ends_the_reset(endpoint: str) -> None:
    plant = HANGING.replace("HangingPlant", "HangingInResetPlant")
    with process("sim", "--plant", plant, "--listen", endpoint) as child, open_rig(connect=endpoint) as link:
        killer = killing(child)
        with pytest.raises(AdapterGoneError, match=r"the (agv|mocap) adapter vanished: .* ago"):
            link.reset(START, run_key="a")
        killer.wait()


def test_a_simulator_that_is_killed_ends_the_exchange(endpoint: str) -> None:
    with process("sim", "--plant", HANGING, "--listen", endpoint) as child, open_rig(connect=endpoint) as link:
        link.reset(START, run_key="a")
        link.control_cycle(NEUTRAL, t_s=0.0, hold_s=0.1)
        killer = killing(child)
        with pytest.raises(AdapterGoneError, match=r"the (agv|mocap) adapter vanished: .* ago"):
            link.control_cycle(NEUTRAL._replace(drive=1700.0), t_s=0.1, hold_s=0.1)
        killer.wait()
        with pytest.raises(AdapterGoneError, match="vanished"):
            link.control_cycle(NEUTRAL, t_s=0.2, hold_s=0.1)


@contextmanager
def suspended(child: subprocess.Popen[str]) -> Iterator[None]:
    child.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        child.send_signal(signal.SIGCONT)


@pytest.mark.parametrize("role", ["agv", "mocap"])
def test_a_suspended_adapter_is_named_long_before_the_answer_limit(endpoint: str, role: str) -> None:
    """The camera is connected through the vehicle's process: it is not blamed when that is suspended."""
    with (
        process("agv", "sim", *SEED, "--plant", TINY, "--listen", endpoint) as agv,
        process("mocap", "sim", *SEED, "--connect", endpoint) as mocap,
        open_rig(connect=endpoint, seed=11) as link,
    ):
        link.reset(START, run_key="a")
        began_s = time.monotonic()
        with suspended({"agv": agv, "mocap": mocap}[role]):
            with pytest.raises(AdapterGoneError, match=f"the {role} adapter vanished: .*if that was suspended"):
                link.reset(START, run_key="b")
            with pytest.raises(AdapterGoneError, match=f"the {role} adapter vanished"):
                link.control_cycle(NEUTRAL, t_s=0.0, hold_s=0.1)
        assert time.monotonic() - began_s < 30.0  # it takes about 3 s, but for a busy machine; the limit is 60 s


def test_a_simulator_with_another_seed_is_refused(endpoint: str) -> None:
    options = AdapterOptions(plant=TINY, seed=1)
    with (
        open_bus_session(listen=[endpoint]) as session,
        host_adapters(session, "lab", options, agv="sim", mocap="sim"),
        pytest.raises(LinkError, match="runs with another seed: 1"),
        open_rig(connect=endpoint, seed=2),
    ):
        pass


def test_an_adapter_that_is_not_there_is_missed(endpoint: str) -> None:
    with (
        open_bus_session(listen=[endpoint]) as session,
        host_adapters(session, "lab", AdapterOptions(plant=TINY), agv="sim", mocap=None),
        pytest.raises(AdapterGoneError, match="no mocap adapter on the bus"),
        open_rig(connect=endpoint, discovery_limit_s=0.3),
    ):
        pass


def test_a_vehicle_without_a_camera_says_so(endpoint: str) -> None:
    """The camera's process is on the bus of the runner, but the vehicle's process does not see it."""
    options = AdapterOptions(plant=TINY)
    with (
        open_bus_session(listen=[endpoint]) as session,
        host_adapters(session, "lab", options, agv="sim", mocap=None),
        open_bus_session(connect=[endpoint]) as other,
        host_adapters(other, "lab", options, agv=None, mocap="sim"),
    ):
        link = VehicleLink(session, "lab", "agv1")
        with link:
            assert len(drive_run(link, "a")) > 0


@pytest.mark.parametrize(
    "numbers", [(signal.SIGINT,), (signal.SIGHUP,), (signal.SIGTERM, signal.SIGHUP)], ids=["int", "hup", "term+hup"]
)
def test_signals_end_a_process_cleanly_also_in_quick_succession(
    endpoint: str, numbers: tuple[signal.Signals, ...]
) -> None:
    # What is ignored here, as SIGHUP is under ``nohup``, the process would ignore, too.
    before = {number: signal.signal(number, signal.default_int_handler) for number in numbers}
    try:
        with process("sim", "--plant", TINY, "--listen", endpoint) as child:
            for number in numbers:
                child.send_signal(number)
            assert child.communicate(timeout=20) == ("stopped\n", "")
            assert child.returncode == 0
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def test_a_second_runner_of_one_vehicle_is_refused_until_the_first_has_gone(endpoint: str, expected: list[str]) -> None:
    with process("sim", *SEED, "--plant", TINY, "--listen", endpoint):
        with (
            open_rig(connect=endpoint, seed=11),
            pytest.raises(LinkError, match="another runner drives this vehicle"),
            open_rig(connect=endpoint, seed=11),
        ):
            pass
        with open_rig(connect=endpoint, seed=11) as link:
            assert [digest(drive_run(link, key)) for key in KEYS] == expected


def test_of_runners_that_start_together_one_has_the_vehicle_until_its_connection_ends(endpoint: str) -> None:
    options = AdapterOptions(plant=TINY)
    with open_bus_session(listen=[endpoint]) as bus, host_adapters(bus, "lab", options, agv="sim", mocap="sim"):
        sessions = [open_bus_session(connect=[endpoint]) for _ in range(4)]

        def start(session: Any) -> VehicleLink | str:
            try:
                return VehicleLink(session, "lab", "agv1")
            except LinkError as error:
                return error.what

        with ThreadPoolExecutor(len(sessions)) as together:
            started = list(together.map(start, sessions))
        links = [link for link in started if isinstance(link, VehicleLink)]
        assert len(links) == 1
        assert started.count("another runner drives this vehicle") == 3
        # It is gone without a word, as a runner that was killed.
        sessions.pop(started.index(links[0])).close()
        deadline_s = time.monotonic() + 20.0
        while isinstance(start(sessions[0]), str):
            assert time.monotonic() < deadline_s
            time.sleep(0.01)
        for session in sessions:
            session.close()
