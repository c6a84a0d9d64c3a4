"""Nobody listens to other machines unless told to: the sockets of whole processes, as the kernel lists them."""

from __future__ import annotations

import os
import socket
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from rig_driving import TINY, process

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="sockets are listed in /proc")
LISTENING = "0A"


def heard_addresses(pid: int) -> list[str]:
    """Return the addresses at which a process takes connections or datagrams."""
    inodes = set()
    for file in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(FileNotFoundError):  # what the listing itself had open
            inodes.add(str(file.readlink()).removeprefix("socket:[").removesuffix("]"))
    heard = []
    for table in ("tcp", "tcp6", "udp", "udp6"):
        listed = Path(f"/proc/{pid}/net/{table}")
        for line in listed.read_text().splitlines()[1:] if listed.exists() else []:
            fields = line.split()
            if fields[9] in inodes and (table.startswith("udp") or fields[3] == LISTENING):
                heard.append(address(fields[1].split(":")[0]))
    return heard


def address(digits: str) -> str:
    data = bytes.fromhex(digits)
    words = [data[at : at + 4][::-1] for at in range(0, len(data), 4)]
    return socket.inet_ntop(socket.AF_INET if len(words) == 1 else socket.AF_INET6, b"".join(words))


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.mark.parametrize(
    "arguments",
    [
        ("sim", "--plant", TINY, "--listen", "tcp/127.0.0.1:{port}"),
        ("mocap", "--emulate", "--port", "0"),
        ("mocap", "--emulate", "--port", "0", "--multicast", "239.255.42.99"),
    ],
)
@pytest.mark.real_time
def test_processes_listen_on_loopback(arguments: tuple[str, ...]) -> None:
    port = free_port()
    with process(*(one.format(port=port) for one in arguments)) as child:
        assert set(heard_addresses(child.pid)) == {"127.0.0.1"}


def test_a_bus_in_one_process_opens_no_socket() -> None:
    from agvbench.adapters import open_rig

    before = heard_addresses(os.getpid())
    with open_rig(plant=TINY):
        assert heard_addresses(os.getpid()) == before


def test_other_listeners_would_be_seen() -> None:
    with socket.socket() as open_to_all:
        open_to_all.bind(("0.0.0.0", 0))  # noqa: S104
        open_to_all.listen()
        assert "0.0.0.0" in heard_addresses(os.getpid())  # noqa: S104
