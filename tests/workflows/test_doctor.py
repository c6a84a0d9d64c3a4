"""``agvbench doctor``: what is ready is said, what is not is said with what to do, and nothing moves."""

from __future__ import annotations

import os
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from agvbench.adapters.natnet.emulator import Emulator, Settings
from agvbench.adapters.natnet.encode import Model
from agvbench.adapters.natnet.frame import FrameOfData
from agvbench.adapters.natnet.layout import BODY, MARKER
from agvbench.cli import main
from agvbench.model import thesis_vehicle
from agvbench.running.vehicles import uncalibrated_vehicle
from agvbench.workflows.doctor import Lab, State, examine


def found(lab: Lab) -> dict[str, tuple[State, str]]:
    """Return state and text of every check."""
    return {name: (finding.state, f"{finding.found} {finding.remedy}") for name, finding in examine(lab)}


def test_a_simulation_is_ready(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["doctor"]) == 0
    said = capsys.readouterr().out
    for name in (
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
    assert found(Lab(folder=tmp_path))["calibration"][0] is State.GOOD
    old_s = file.stat().st_mtime - 40 * 86_400
    os.utime(file, (old_s, old_s))
    state, said = found(Lab(folder=tmp_path))["calibration"]
    assert (state, "40 days old (limit: 30)" in said) == (State.DOUBTFUL, True)
    own = tmp_path / "vehicle.toml"
    uncalibrated_vehicle().save(own)
    assert str(file) in found(Lab(folder=tmp_path))["calibration"][1]
    replace(thesis_vehicle(), provenance={"campaign": "monday"}).save(own)
    assert found(Lab(folder=tmp_path))["calibration"][0] is State.GOOD
    file.write_text("not = [toml")
    assert found(Lab(folder=tmp_path))["calibration"][0] is State.BAD


def test_a_small_floor_is_said(tmp_path: Path) -> None:
    state, said = found(Lab(workspace="circle:2", folder=tmp_path))["workspace"]
    assert state is State.DOUBTFUL
    assert "do not fit circle:2" in said
    assert found(Lab(workspace="circle:x", folder=tmp_path))["workspace"][0] is State.BAD


def test_a_port_is_looked_at_and_not_opened(tmp_path: Path) -> None:
    master, slave = os.openpty()
    try:
        state, said = found(Lab(agv=f"serial:{os.ttyname(slave)}", folder=tmp_path))["serial ports"]
        assert (state, "may be used" in said) == (State.GOOD, True)
    finally:
        os.close(master)
        os.close(slave)
    state, said = found(Lab(agv="serial:/dev/none", folder=tmp_path))["serial ports"]
    assert (state, "no port '/dev/none'" in said) == (State.BAD, True)


def test_a_bus_that_is_not_secured_has_no_certificates(tmp_path: Path) -> None:
    assert found(Lab(folder=tmp_path))["certificates"][0] is State.IDLE
    state, said = found(Lab(folder=tmp_path, bus_config=str(tmp_path / "none.json5")))["certificates"]
    assert (state, "none.json5: cannot be read" in said) == (State.BAD, True)


def test_a_folder_that_is_not_there_is_said(tmp_path: Path) -> None:
    assert found(Lab(folder=tmp_path / "none"))["disk"][0] is State.BAD


@pytest.mark.parametrize(("body", "state", "said"), [
    ("agv1", State.GOOD, "streams NatNet 4.1 at 120 Hz; agv1; capture times known to ±"),
    ("agv7", State.BAD, "no rigid body is called 'agv7' (there are: agv1) rename"),
])  # fmt: skip
def test_cameras_are_asked_for_the_vehicle(tmp_path: Path, body: str, state: State, said: str) -> None:
    server = Emulator(Settings(), [Model(1, "agv1")])
    frame = FrameOfData(0, np.zeros(1, BODY), np.zeros(0, MARKER), 0.0, 0, 0, 0, 0)
    streaming = True

    def stream() -> None:
        number = 0
        while streaming:
            number += 1
            server.send(frame._replace(number=number, exposed_ticks=server.ticks()))
            time.sleep(1 / 120)

    thread = threading.Thread(target=stream)
    thread.start()
    try:
        host, port = server.address
        lab = Lab(mocap=f"natnet:{host}:{port}", camera={"body": body}, folder=tmp_path)
        found_state, found_text = found(lab)["mocap"]
    finally:
        streaming = False
        thread.join()
        server.close()
    assert said in found_text
    assert found_state is state
