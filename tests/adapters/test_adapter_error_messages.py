"""Every mistake in docs/reference/errors-bus.md ends in exactly the line that stands there."""

from __future__ import annotations

import re
import socket
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rig_driving import FAILING, NEUTRAL, START, TINY

from agvbench.adapters import AdapterOptions, host_adapters, open_rig
from agvbench.bus.bus_config import BusConfig
from agvbench.bus.link import VehicleLink
from agvbench.bus.messages.codec import MAX_MESSAGE_BYTES, decoder, encode
from agvbench.bus.messages.command import CommandMessage, decode_command
from agvbench.bus.messages.frames import FramesMessage, pack_columns, unpack_columns
from agvbench.bus.messages.identity import AgvIdentity, Identity, MocapIdentity
from agvbench.bus.session import open_bus_session
from agvbench.cli import main
from agvbench.errors import AgvbenchError
from agvbench.types import Command, Frames
from agvbench.vehicle.channels import Channels

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "errors-bus.md"
LINES = dict(re.findall(r"^\| ([^|]+) \| `(.+)` \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE))


def command_line(*arguments: str) -> Callable[[], int]:
    return lambda: main(list(arguments))


@contextmanager
def placed(**options: Any) -> Iterator[VehicleLink]:
    with open_rig(**({"plant": TINY} | options)) as link:
        link.reset(START, run_key="a")
        link.control_cycle(NEUTRAL, t_s=0.0, hold_s=0.5)
        yield link


def rig(**options: Any) -> Callable[[], None]:
    def open_it() -> None:
        with open_rig(**({"plant": TINY} | options)):
            pass

    return open_it


def control_cycle(
    command: Command = NEUTRAL, t_s: float = 0.5, hold_s: float = 0.5, **options: Any
) -> Callable[[], object]:
    def exchange_once() -> object:
        with placed(**options) as link:
            return link.control_cycle(command, t_s=t_s, hold_s=hold_s)

    return exchange_once


def real_and_simulated(agv_simulated: bool) -> Callable[[], Identity]:
    agv = AgvIdentity("blue", "serial", "1.0", "", Channels.alike("us"), simulated=agv_simulated, lock_step=False)
    return lambda: Identity.of(agv, MocapIdentity("sim", 120.0, simulated=not agv_simulated))


def without_a_camera() -> None:
    with (
        open_bus_session() as session,
        host_adapters(session, "lab", AdapterOptions(plant=TINY), agv="sim", mocap=None),
    ):
        VehicleLink(session, "lab", "agv1", discovery_limit_s=0.1)


def another_seed() -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    options = AdapterOptions(plant=TINY, seed=1)
    with open_bus_session(listen=[endpoint]) as session, host_adapters(session, "lab", options, agv="sim", mocap="sim"):
        rig(connect=endpoint, seed=2)()


def damaged(payload: bytes, decode: Callable[[bytes], object]) -> Callable[[], object]:
    return lambda: decode(payload)


def a_configuration_that_listens() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "listens.json5"
        path.write_text('{listen: {endpoints: ["tcp/0.0.0.0:7447"]}}')
        BusConfig.load(path)


CAMERA = """
import threading
from agvbench.adapters import MocapAdapter, MocapIdentity

class Camera(MocapAdapter):
    option_names = ("body",)
    @classmethod
    def open(cls, address, options):
        return cls()
    def identity(self):
        return MocapIdentity(adapter="labcam", rate_hz=100.0, simulated=False)
    def start(self, reports):
        self.go = threading.Event()
        self.thread = threading.Thread(target=self.run, name="frames")
        self.thread.start()
    def run(self):
        if self.go.wait(0.3) is False:
            {}["x"]
    def close(self):
        self.go.set()
"""


def camera_file(change: str = "") -> str:
    """Return the path of a camera in a file, with other methods if `change` contains some."""
    file = Path(tempfile.mkdtemp()) / "labcam.py"
    file.write_text(CAMERA + change, encoding="utf-8")
    return str(file)


def own_camera(change: str = "", *options: str) -> Callable[[], int]:
    return lambda: main(["mocap", camera_file(change), *options])


def a_thread_that_ends() -> None:
    with open_rig(f"{Path(__file__).with_name('still_vehicle.py')}", camera_file()) as link:
        link.control_cycle(NEUTRAL, t_s=0.0, hold_s=10.0)


COMMAND = encode(CommandMessage(1, 0.0, NEUTRAL, 0.1))
FRAMES = encode(FramesMessage(1, 0, b""))
NAN_TIME = pack_columns(Frames(*(np.full(1, np.nan),) * 4, np.ones(1, bool), np.zeros(1, int), *(np.zeros(1),) * 2))

MISTAKES: dict[str, Callable[[], object]] = {
    "no endpoint": command_line("sim", "--listen", "localhost"),
    "protocol that loses messages": command_line("sim", "--connect", "udp/127.0.0.1:7447"),
    "port out of range": command_line("sim", "--listen", "tcp/127.0.0.1:70000"),
    "no listener at the endpoint": lambda: open_bus_session(connect=["tcp/127.0.0.1:9"], timeout_s=0.1),
    "address of another machine": command_line("mocap", "sim", "--listen", "tcp/192.0.2.1:7448"),
    "endpoint open to other machines without permission": lambda: open_bus_session(listen=["tcp/0.0.0.0:7447"]),
    "certificates are not named": command_line("sim", "--listen", "tls/192.0.2.1:7447"),
    "configuration of the bus is missing": command_line("sim", "--bus-config", "no.json5"),
    "configuration contains an endpoint": a_configuration_that_listens,
    "vehicle's name with a slash": command_line("sim", "--vehicle-name", "blue/one"),
    "lab's name is empty": command_line("agv", "sim", "--lab", ""),
    "no such adapter": command_line("agv", "simm"),
    "no such mocap adapter": command_line("mocap", "optitrak:192.0.2.7"),
    "address for a simulated camera": command_line("mocap", "sim:192.0.2.7"),
    "camera option without value": command_line("sim", "--camera", "lost"),
    "unknown option of a camera in a file": own_camera("", "--camera", "bdy=1"),
    "option of a camera without options": own_camera("    option_names = ()\n", "--camera", "body=1"),
    "identity of another type": own_camera("    def identity(self): return 5\n"),
    "start raises": own_camera("    def start(self, reports): raise KeyError('cable')\n"),
    "exception in a thread of an adapter": a_thread_that_ends,
    "check without an adapter": command_line("mocap", "--check", "--emulate"),
    "doctor: camera is not named": command_line("doctor", "--mocap"),
    "unknown plant": command_line("sim", "--plant", "my_plant.py"),
    "no camera on the bus": without_a_camera,
    "another seed": another_seed,
    "real vehicle, simulated camera": real_and_simulated(False),
    "simulated vehicle, real camera": real_and_simulated(True),
    "command is NaN": control_cycle(Command(float("nan"), 1500.0, 1500.0)),
    "hold is negative": control_cycle(hold_s=-1.0),
    "time goes back": control_cycle(t_s=0.25),
    "time jumps forward": control_cycle(t_s=9.0),
    "plant raises": control_cycle(Command(1700.0, 1500.0, 1500.0), plant=FAILING),
    "message of another program": damaged(b"\x00" * 64, decode_command),
    "message of another version": damaged(b"AGVB\x03\x01" + bytes(58), decode_command),
    "message of another kind": damaged(COMMAND, decoder(FramesMessage)),
    "message is cut off": damaged(COMMAND[:-1], decode_command),
    "message is too long": damaged(bytes(MAX_MESSAGE_BYTES + 1), decode_command),
    "bytes behind a message": damaged(COMMAND + b"\x00", decode_command),
    "message with an unknown field": damaged(COMMAND.replace(b"hold_s", b"hold_x"), decode_command),
    "message with a wrong type": damaged(COMMAND.replace(b"flags\x00", b"flags\xc0"), decode_command),
    "columns do not fit their count": damaged(FRAMES.replace(b"count\x00", b"count\x01"), decoder(FramesMessage)),
    "message claims too many rows": damaged(
        FRAMES.replace(b"count\x00", b"count\xce" + b"\xff" * 4), decoder(FramesMessage)
    ),
    "message with unknown flags": damaged(COMMAND.replace(b"flags\x00", b"flags\x08"), decode_command),
    "frames without a time": lambda: unpack_columns([NAN_TIME]),
}


def test_the_page_and_the_mistakes_are_the_same() -> None:
    assert set(MISTAKES) == set(LINES)


@pytest.mark.parametrize("mistake", MISTAKES)
def test_message(mistake: str, capsys: pytest.CaptureFixture[str]) -> None:
    try:
        code = MISTAKES[mistake]()
    except AgvbenchError as error:
        line = str(error)
    else:
        assert code == 2
        line = capsys.readouterr().err.removesuffix("\n").splitlines()[-1]
    assert re.sub(r"/\S*/", "", line) == LINES.get(mistake) or line == LINES.get(mistake)
