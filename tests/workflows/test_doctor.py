"""``agvbench doctor``: what is ready is said, what is not is said with what to do, and nothing moves."""

from __future__ import annotations

import os
import re
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from agvbench.adapters import AdapterOptions, host_adapters
from agvbench.adapters.natnet.emulator import Emulator, Settings
from agvbench.adapters.natnet.protocol.bitstream import BODY, MARKER, TRACKED
from agvbench.adapters.natnet.protocol.encode import Model
from agvbench.adapters.natnet.protocol.frame import FrameOfData
from agvbench.bus.session import open_bus_session
from agvbench.cli import main
from agvbench.errors import AgvbenchError, VehicleError
from agvbench.model import example_vehicle, thesis_vehicle
from agvbench.running.configuration.settings import BenchSettings
from agvbench.running.configuration.vehicles import uncalibrated_vehicle
from agvbench.workflows.doctor import FindingState, Lab, examine
from agvbench.workflows.doctor.checks.adapters import AdaptersCheck
from agvbench.workflows.doctor.checks.ports import PortsCheck
from agvbench.workflows.doctor.checks.workspace import FloorCheck


def lab(folder: Path, **settings: str) -> Lab:
    """Return a lab that records into `folder`."""
    return Lab(BenchSettings.given(settings), folder)


def found(lab: Lab, *only: str) -> dict[str, tuple[FindingState, str]]:
    """Return state and text of every check, or of those named in `only`."""
    return {
        name: (finding.state, f"{finding.found} {finding.remedy}")
        for name, finding in examine(lab)
        if not only or name in only
    }


def test_a_simulation_is_ready(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["doctor"]) == 0
    said = capsys.readouterr().out
    for name in (
        "adapters",
        "bus",
        "calibration",
        "certificates",
        "clock",
        "disk",
        "firmware",
        "mocap",
        "serial ports",
        "workspace",
    ):
        assert f"\n{name}" in f"\n{said}"
    assert "no calibrated vehicle here" in said


def test_a_calibration_grows_old(tmp_path: Path) -> None:
    file = tmp_path / "campaigns" / "monday" / "vehicle.toml"
    file.parent.mkdir(parents=True)
    thesis_vehicle().save(file)
    assert found(Lab(folder=tmp_path))["calibration"][0] is FindingState.GOOD
    old_s = file.stat().st_mtime - 40 * 86_400
    os.utime(file, (old_s, old_s))
    state, said = found(Lab(folder=tmp_path))["calibration"]
    assert (state, "40 days old (limit: 30)" in said) == (FindingState.DOUBTFUL, True)
    own = tmp_path / "vehicle.toml"
    uncalibrated_vehicle().save(own)
    assert str(file) in found(Lab(folder=tmp_path))["calibration"][1]
    replace(thesis_vehicle(), provenance={"campaign": "monday"}).save(own)
    assert found(Lab(folder=tmp_path))["calibration"][0] is FindingState.GOOD
    file.write_text("not = [toml")
    assert found(Lab(folder=tmp_path))["calibration"][0] is FindingState.BAD


def test_a_small_floor_is_said(tmp_path: Path) -> None:
    state, said = found(lab(tmp_path, workspace="circle:2"))["workspace"]
    assert state is FindingState.DOUBTFUL
    assert "cannot be driven by the thesis' vehicle on circle:2" in said
    assert found(lab(tmp_path, workspace="circle:x"))["workspace"][0] is FindingState.BAD


def test_a_port_is_looked_at(tmp_path: Path) -> None:
    master, slave = os.openpty()
    try:
        finding = PortsCheck().examine(lab(tmp_path, agv=f"serial:{os.ttyname(slave)}"))
        assert (finding.state, "may be used" in finding.found) == (FindingState.GOOD, True)
    finally:
        os.close(master)
        os.close(slave)
    state, said = found(lab(tmp_path, agv="serial:/dev/none"))["serial ports"]
    assert (state, "no port '/dev/none'" in said) == (FindingState.BAD, True)


def test_a_bus_that_is_not_secured_has_no_certificates(tmp_path: Path) -> None:
    assert found(Lab(folder=tmp_path))["certificates"][0] is FindingState.IDLE
    state, said = found(lab(tmp_path, bus_config=str(tmp_path / "none.json5")))["certificates"]
    assert (state, "none.json5: cannot be read" in said) == (FindingState.BAD, True)


def test_a_folder_that_is_not_there_is_said(tmp_path: Path) -> None:
    assert found(Lab(folder=tmp_path / "none"))["disk"][0] is FindingState.BAD


@contextmanager
def natnet_server(*, tracked: bool = True) -> Iterator[str]:
    """Stream the rigid body agv1 at 120 Hz while the context lasts; give the adapter's specification."""
    server, over = Emulator(Settings(), [Model(1, "agv1")]), threading.Event()
    body = np.zeros(1, BODY)
    body["id"], body["flags"], body["quaternion"], body["position_m"] = 1, tracked * TRACKED, (0, 0, 0, 1), (1, 0, -2)
    frame = FrameOfData(0, body, np.zeros(0, MARKER), 0.0, 0, 0, 0, 0)

    def stream() -> None:
        number, began_s = 0, time.monotonic()
        while not over.wait(max(0.0, began_s + number / 120 - time.monotonic())):
            number += 1
            server.send(frame._replace(number=number, exposed_ticks=server.ticks()))

    thread = threading.Thread(target=stream)
    thread.start()
    try:
        host, port = server.address
        yield f"natnet:{host}:{port}"
    finally:
        over.set()
        thread.join()
        server.close()


@pytest.mark.parametrize(("body", "tracked", "state", "said"), [
    ("agv1", True, FindingState.GOOD, r"streams NatNet 4.1 at 120 Hz; agv1; capture times known to ±"),
    ("agv1", True, FindingState.GOOD, r"natnet: \d+\.\d frames/s, 100 % tracked, last pose x = 1.000 m, y = 2.000"),
    ("agv1", False, FindingState.DOUBTFUL, r"natnet: \d+\.\d frames/s, 0 % tracked put the vehicle into view"),
    ("agv7", True, FindingState.BAD, r"no rigid body is called 'agv7' \(there are: agv1\) rename"),
    ("²", True, FindingState.BAD, r"no rigid body is called '²' \(there are: agv1\) rename"),
])  # fmt: skip
@pytest.mark.real_time
def test_cameras_are_asked_for_the_vehicle(
    tmp_path: Path, body: str, tracked: bool, state: FindingState, said: str
) -> None:
    with natnet_server(tracked=tracked) as spec:
        found_state, found_text = found(lab(tmp_path, mocap=spec, camera=f"body={body}"), "mocap")["mocap"]
    assert re.search(said, found_text), found_text
    assert found_state is state


CAMERA = """
import math, threading
from agvbench.adapters import FrameClock, MocapAdapter, MocapIdentity

class Camera(MocapAdapter):
    def __init__(self, options, sends):
        self.clock, self.closed, self.sends = options.clock, threading.Event(), sends
        self.thread = threading.Thread(target=self.run)
    @classmethod
    def open(cls, address, options):
        return cls(options, address == "sends")
    def identity(self):
        return MocapIdentity(adapter="labcam", rate_hz=100.0, simulated=False)
    def start(self, reports):
        self.reports = reports
        self.thread.start()
    def run(self):
        next_s = self.clock.now()
        while not self.closed.wait(max(0.0, next_s - self.clock.now())):
            next_s += 0.01
            if self.sends:
                self.reports.frame(self.clock.now(), 1.0, 2.0, 0.0, clock=FrameClock.ADAPTER)
    def close(self):
        self.closed.set()
        if self.thread.is_alive():
            self.thread.join()
"""


@pytest.mark.real_time
def test_a_camera_of_a_lab_is_listened_to(tmp_path: Path) -> None:
    file = tmp_path / "labcam.py"
    file.write_text(CAMERA)
    state, said = found(lab(tmp_path, mocap=f"{file}:sends"), "mocap")["mocap"]
    assert state is FindingState.GOOD
    assert re.match(r"labcam: \d+\.\d frames/s, 100 % tracked, last pose x = 1.000 m, y = 2.000 m, heading 0", said)
    checks = found(lab(tmp_path, mocap=f"{file}:silent"), "mocap", "adapters")
    assert checks["mocap"][0] is FindingState.BAD
    assert checks["mocap"][1].startswith("labcam: no frame arrived start the camera's stream")
    assert checks["adapters"][1] == "labcam is opened, nominal rate 100 Hz "


def test_a_broken_camera_of_a_lab_is_said(tmp_path: Path) -> None:
    file = tmp_path / "labcam.py"
    file.write_text(CAMERA + "    def start(self, reports): raise KeyError('cable')\n")
    state, said = found(lab(tmp_path, mocap=str(file)), "mocap")["mocap"]
    assert (state, said) == (FindingState.BAD, "the mocap adapter failed: KeyError: 'cable' ")
    file.write_text(CAMERA + "    def identity(self): return 5\n")
    for state, said in found(lab(tmp_path, mocap=str(file)), "adapters", "mocap").values():
        assert (state, said.startswith("mocap adapter: identity is no MocapIdentity: 5; return one")) == (
            FindingState.BAD, True,
        )  # fmt: skip


@pytest.mark.real_time
def test_a_camera_on_the_bus_is_listened_to_without_a_vehicle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "labcam.py"
    file.write_text(CAMERA)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    with (
        open_bus_session(listen=[endpoint]) as session,
        host_adapters(session, "lab", AdapterOptions(), agv=None, mocap=f"{file}:sends"),
    ):
        assert main(["doctor", "--connect", endpoint, "--mocap"]) == 0
    said = capsys.readouterr().out
    assert re.search(r"\nmocap +ok +labcam: \d+\.\d frames/s, 100 % tracked", said)
    assert re.search(r"^adapters +not asked +the camera on the bus is examined alone: see mocap", said)
    assert main(["doctor", "--mocap"]) == 2
    assert "--mocap: no camera is named; add --connect ENDPOINT, or name an adapter" in capsys.readouterr().err


def test_only_a_simulation_asks_for_cameras(tmp_path: Path) -> None:
    assert "give the cameras" in found(lab(tmp_path), "mocap")["mocap"][1]
    state, said = found(lab(tmp_path, mocap="natnet:emulated"), "mocap")["mocap"]
    assert (state, "give the cameras" in said) == (FindingState.IDLE, False)


@pytest.mark.parametrize(("settings", "said"), [
    ({"plant": "agvbench.simulator:make_none"}, "make_none"),
    ({"agv": "serial:/dev/none"}, "/dev/none"),
])  # fmt: skip
def test_an_adapter_that_does_not_exist_fails(settings: dict[str, str], said: str, tmp_path: Path) -> None:
    with pytest.raises(AgvbenchError, match=said):
        AdaptersCheck().examine(lab(tmp_path, **settings))


def test_what_fails_is_the_exit_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["doctor", "--plant=none.py:make_plant"]) == 1
    assert "adapters      fails      none.py: there is no such file" in capsys.readouterr().out


def test_a_vehicle_that_commands_in_another_unit_than_its_file_says_fails(tmp_path: Path) -> None:
    file = tmp_path / "car.toml"
    example_vehicle("front_steered").save(file)
    own = tmp_path / "microseconds.py"
    own.write_text(
        "from agvbench.adapters import AdapterOptions\n"
        "from agvbench.adapters.agv.live import LiveAgv\n"
        "class Microseconds(LiveAgv):\n"
        "    scheme = 'microseconds'\n"
        "    @classmethod\n"
        "    def open(cls, address, options):\n"
        "        return super().open('', AdapterOptions(vehicle=options.vehicle))\n"
    )
    with pytest.raises(VehicleError, match="commands in another unit than its file says: normalised"):
        AdaptersCheck().examine(lab(tmp_path, agv=str(own), vehicle=str(file)))


def test_the_trajectories_of_this_folder_are_planned_for_its_vehicle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    example_vehicle("front_steered").save(tmp_path / "vehicle.toml")
    (tmp_path / "trajectories").mkdir()
    tight = 'schema = 1\nname = "tight"\n[[segments]]\nkind = "arc"\nturn = "left"\nradius_m = 0.01\nangle_deg = 9'
    (tmp_path / "trajectories" / "tight.toml").write_text(tight)
    finding = FloorCheck().examine(lab(tmp_path, vehicle="vehicle.toml"))
    assert (finding.state, "trajectories tight cannot be driven" in finding.found) == (FindingState.DOUBTFUL, True)
    (tmp_path / "trajectories" / "tight.toml").write_text(tight.replace("0.01", "1.0"))
    finding = FloorCheck().examine(lab(tmp_path, vehicle="vehicle.toml"))
    assert (finding.state, "eight trajectories and tight can be driven" in finding.found) == (FindingState.GOOD, True)
