"""Sessions: explicit endpoints, loopback unless said otherwise, one line for what does not work."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest

from agvbench.bus.session import open_bus_session, parse_endpoint
from agvbench.errors import LinkError
from agvbench.loopback import is_loopback


@pytest.mark.parametrize(
    "endpoint",
    ["", "localhost", "127.0.0.1:7447", "tcp/127.0.0.1", "tcp/:7447", "tcp/1.2.3.4:70000", "tcp/1.2.3.4:0",
     "tcp/127.0.0.1:7447#iface=eth0", "tcp/a b:1", "udp/127.0.0.1:7447", "TCP/127.0.0.1:7447", "tcp/127.0.0.1:7447\n"],
)  # fmt: skip
def test_endpoints_that_cannot_be_used_are_refused(endpoint: str) -> None:
    with pytest.raises(LinkError):
        parse_endpoint(endpoint)
    with pytest.raises(LinkError):
        open_bus_session(connect=[endpoint])


def test_endpoints_that_can_be_used() -> None:
    assert parse_endpoint("tcp/[::1]:7447") == ("tcp", "::1", 7447)
    assert parse_endpoint("tcp/mocap-pc.lab:7448") == ("tcp", "mocap-pc.lab", 7448)


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.2", "[::]", "lab-pc"])  # noqa: S104
def test_other_machines_are_kept_out_unless_asked_in(host: str) -> None:
    with pytest.raises(LinkError, match="let other machines drive the vehicle"):
        open_bus_session(listen=[f"tcp/{host}:7447"])
    assert not is_loopback(host.strip("[]"))


def test_a_session_without_endpoints_opens_no_socket() -> None:
    with open_bus_session() as session:
        assert list(session.info.links()) == []
        assert list(session.info.transports()) == []


def test_nobody_answers(free_port: Callable[[], int]) -> None:
    port = free_port()
    with pytest.raises(LinkError, match=f"connect tcp/127.0.0.1:{port}: no answer"):
        open_bus_session(connect=[f"tcp/127.0.0.1:{port}"], timeout_s=0.2)


def test_a_port_that_is_taken() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(LinkError, match="endpoint cannot be used") as caught:
            open_bus_session(listen=[f"tcp/127.0.0.1:{taken.getsockname()[1]}"])
    assert ".rs" not in str(caught.value)
    assert "\n" not in str(caught.value)


def test_connections_that_never_say_who_they_are_do_not_lock_out_others(free_port: Callable[[], int]) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    address = parse_endpoint(endpoint)[1:]
    with open_bus_session(listen=[endpoint]), ExitStack() as idle:
        for _ in range(300):
            idle.enter_context(socket.create_connection(address))
        open_bus_session(connect=[endpoint]).close()


@pytest.mark.slow
@pytest.mark.real_time
def test_a_process_leaves_the_bus_without_an_error_where_a_receiver_takes_nothing(free_port: Callable[[], int]) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with ExitStack() as stack:

        def start(script: Path) -> subprocess.Popen[str]:
            pipe = subprocess.PIPE
            command = [sys.executable, str(script), endpoint]
            process = stack.enter_context(subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True))
            stack.callback(process.kill)
            assert process.stdout is not None
            assert process.stdout.readline() == "listening\n"
            return process

        sender = start(Path(__file__).with_name("send_too_much.py"))
        receiver = start(Path(__file__).parents[1] / "faults" / "never_take.py")
        assert sender.stdout is not None
        assert sender.stdout.readline() == "matched\n"
        receiver.send_signal(signal.SIGSTOP)
        assert sender.communicate("send\n", timeout=60.0) == ("left\n", "")
        assert sender.returncode == 0
