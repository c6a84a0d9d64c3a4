"""Adapters from a file of one's own: the how-to's example drives over UDP, and mistakes are one line."""

from __future__ import annotations

import json
import re
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from rig_driving import NEUTRAL
from tiny_plant import TinyPlant

from agvbench.adapters import AdapterOptions, check_specs, open_rig
from agvbench.adapters.frame_recorder import FrameRecorder
from agvbench.adapters.registry import open_agv, open_mocap
from agvbench.bus.clock import WallClock
from agvbench.cli import main
from agvbench.errors import LinkError
from agvbench.types import Command

pytestmark = pytest.mark.real_time

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "write-an-adapter.md"


class Lab:
    """A vehicle that obeys JSON and cameras that tell JSON, in a thread."""

    def __init__(self) -> None:
        self.told: list[dict[str, float]] = []
        self._vehicle, self._cameras = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self._vehicle.bind(("127.0.0.1", 0))
        self._vehicle.setblocking(False)
        self.vehicle_port = self._vehicle.getsockname()[1]
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            self.camera_port = probe.getsockname()[1]
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._live, daemon=True)
        self._thread.start()

    def _live(self) -> None:
        plant, pose, number = TinyPlant(0), (0.0, 0.0, 0.0), 0
        plant.reset(pose, seed=0)
        command = {"drive": 1500.0, "front": 1500.0, "rear": 1500.0}
        before_s = time.monotonic()
        while not self._over.wait(0.01):
            while True:
                try:
                    command = json.loads(self._vehicle.recv(1000))
                except BlockingIOError:
                    break
                self.told.append(command)
            now_s = time.monotonic()
            pose, before_s, number = plant.advance(**command, dt=now_s - before_s), now_s, number + 1
            said = json.dumps(dict(zip(("n", "x", "y", "yaw"), (number, *pose), strict=True)))
            self._cameras.sendto(said.encode(), ("127.0.0.1", self.camera_port))

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        self._vehicle.close()
        self._cameras.close()


@pytest.fixture
def lab() -> Iterator[Lab]:
    opened = Lab()
    yield opened
    opened.close()


@pytest.fixture
def file(tmp_path: Path) -> Path:
    source = re.search(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert source is not None
    (tmp_path / "my_lab.py").write_text(source[1], encoding="utf-8")
    return tmp_path / "my_lab.py"


def test_the_how_tos_vehicle_drives_is_seen_and_is_stopped(file: Path, lab: Lab) -> None:
    with open_rig(f"{file}:127.0.0.1:{lab.vehicle_port}", f"{file}:{lab.camera_port}") as link:
        assert (link.identity().firmware, link.identity().simulated) == ("my firmware 3", False)
        assert link.identity().agv.adapter == "my_lab"
        link.control_cycle(NEUTRAL, t_s=0.0, hold_s=0.3)
        frames = link.control_cycle(Command(1900.0, 1500.0, 1500.0), t_s=0.3, hold_s=0.8)
    assert frames.x_m[-1] - frames.x_m[0] > 0.05
    deadline_s = time.monotonic() + 10.0
    while lab.told[-1]["drive"] != 1500.0 and time.monotonic() < deadline_s:
        time.sleep(0.01)
    assert {"drive": 1900.0, "front": 1500.0, "rear": 1500.0} in lab.told
    assert lab.told[-1] == {"drive": 1500.0, "front": 1500.0, "rear": 1500.0}


def test_faults_stand_in_front_of_it_too(file: Path) -> None:
    camera = open_mocap(f"impaired:frozen@1/2:{file}:0", AdapterOptions())
    assert camera.identity().adapter == "my_lab"
    camera.close()


def send(port: int, *lines: dict[str, object]) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for line in lines:
            sender.sendto(json.dumps(line).encode(), ("127.0.0.1", port))


POSE: dict[str, object] = {"x": 1.0, "y": 2.0, "yaw": 0.5}


def test_the_how_tos_cameras_choose_a_body_and_need_no_number(file: Path, lab: Lab) -> None:
    lab.close()
    camera = open_mocap(f"{file}:{lab.camera_port}", AdapterOptions(camera={"body": "blue"}))
    recorder = FrameRecorder(WallClock())
    camera.start(recorder)
    send(lab.camera_port, {"body": "red", **POSE}, {"body": "blue", "n": 7, **POSE}, {"body": "blue", **POSE})
    deadline_s, frames = time.monotonic() + 10.0, []
    while len(frames) < 2 and time.monotonic() < deadline_s:
        frames += [int(batch.frames.frame[0]) for batch in recorder.take()]
        time.sleep(0.01)
    camera.close()
    assert frames == [7, -1]


@pytest.mark.parametrize("line", ['{"n": 1}', "[1]", "{", '{"x": "a", "y": 1, "yaw": 1}'])
def test_a_wrong_line_of_the_how_tos_cameras_is_said(line: str, file: Path, lab: Lab) -> None:
    lab.close()
    with open_rig(f"{file}:127.0.0.1:9", f"{file}:{lab.camera_port}") as link:
        link.control_cycle(NEUTRAL, t_s=0.0, hold_s=0.01)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.sendto(line.encode(), ("127.0.0.1", lab.camera_port))
        with pytest.raises(LinkError, match="mocap adapter: not a line of my cameras: "):
            link.control_cycle(NEUTRAL, t_s=0.1, hold_s=10.0)


@pytest.mark.parametrize("impaired", ["", "impaired:lost=0:"])
def test_a_thread_that_an_exception_ends_is_said(impaired: str, file: Path, lab: Lab) -> None:
    source = file.read_text(encoding="utf-8").replace("KeyError, TypeError, AttributeError", "TypeError")
    file.write_text(source, encoding="utf-8")
    lab.close()
    before = threading.excepthook
    with open_rig(f"{file}:127.0.0.1:9", f"{impaired}{file}:{lab.camera_port}") as link:
        link.control_cycle(NEUTRAL, t_s=0.0, hold_s=0.01)
        send(lab.camera_port, {"n": 1})
        with pytest.raises(LinkError) as caught:
            link.control_cycle(NEUTRAL, t_s=0.1, hold_s=10.0)
    number = 1 + next(n for n, text in enumerate(source.splitlines()) if 'seen = said["x"]' in text)
    assert str(caught.value) == (
        "mocap adapter: my-cameras: an exception ended a thread of the adapter: KeyError: 'x'; "
        f"catch it and call reports.failed; look at my_lab.py, line {number}"
    )
    assert threading.excepthook is before


def test_a_camera_that_cannot_start_is_one_line_and_closed(file: Path) -> None:
    source = file.read_text(encoding="utf-8").replace(
        "        self.thread.start()\n", "        raise KeyError('start')\n"
    )
    file.write_text(source, encoding="utf-8")
    with pytest.raises(LinkError, match="the mocap adapter failed: KeyError: 'start'"), open_rig("live", f"{file}:0"):
        pass


BODY = "    def open(cls, address, options): pass\n"


@pytest.mark.parametrize(
    ("source", "line"),
    [
        (None, "own.py: there is no such file; write path/to/FILE.py or path/to/FILE.py:ADDRESS"),
        ("import nothing_of_the_kind", "own.py: raised ModuleNotFoundError: No module named 'nothing_of_the_kind'"),
        ("x = ", "own.py: raised SyntaxError: invalid syntax; look at own.py, line 1"),
        ("x = 1", "own.py: no AgvAdapter; derive a class from agvbench.adapters.AgvAdapter"),
        (
            f"from agvbench.adapters import AgvAdapter\nclass Mine(AgvAdapter):\n{BODY}",
            "own.py: Mine lacks methods: apply close identity stop; define them",
        ),
    ],
)
def test_a_file_that_is_no_adapter_is_one_line(
    source: str | None, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    if source is not None:
        (tmp_path / "own.py").write_text(source, encoding="utf-8")
    for ask in (lambda: open_agv("own.py", AdapterOptions()), lambda: check_specs("own.py", "sim", AdapterOptions())):
        with pytest.raises(LinkError) as caught:
            ask()
        assert str(caught.value).startswith(line)


def test_several_in_one_file_are_too_many(file: Path) -> None:
    source = file.read_text(encoding="utf-8")
    file.write_text(source + "\n\nclass Another(UdpVehicle):\n    pass\n", encoding="utf-8")
    with pytest.raises(LinkError, match=r"several AgvAdapters: UdpVehicle Another; give each a file of its own"):
        open_agv(f"{file}:h:1", AdapterOptions())


def test_what_opening_it_raises_is_one_line(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    specs = [f"--agv={file}:127.0.0.1:port", f"--mocap={file}:0"]
    assert main(["bench", *specs, f"--out={file.parent / 'c'}"]) == 2
    said = capsys.readouterr()
    number = 1 + next(n for n, text in enumerate(file.read_text(encoding="utf-8").splitlines()) if "int(port)" in text)
    line = "my_lab.py: raised ValueError: invalid literal for int() with base 10: 'port'; look at my_lab.py, line"
    assert f"{line} {number}" in said.out + said.err


def test_what_opening_and_closing_it_does_wrong_is_one_line(file: Path) -> None:
    source = file.read_text(encoding="utf-8")
    file.write_text(source + "\n    @classmethod\n    def open(cls, address, options): pass\n", encoding="utf-8")
    with pytest.raises(LinkError, match=r"my_lab.py: open returned something else: None; return an instance of"):
        open_mocap(f"{file}:0", AdapterOptions())
    file.write_text(source + "\n    def close(self): raise RuntimeError('stuck')\n", encoding="utf-8")
    with pytest.raises(LinkError, match="the mocap adapter failed: RuntimeError: stuck"), open_rig(mocap=f"{file}:0"):
        pass
