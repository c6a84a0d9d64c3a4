"""The contract checks of an adapter: every shipped camera passes them, and each breach is one line with a remedy."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from natnet_server import natnet_server

from agvbench.adapters import AdapterOptions
from agvbench.adapters.contract_checks import CheckResult, check_camera, check_vehicle
from agvbench.adapters.registry import mocap_adapters
from agvbench.cli import main
from agvbench.errors import AgvbenchError

pytestmark = pytest.mark.real_time

# What an adapter needs in order to be checked here; one that is not listed needs nothing but its scheme.
SPECIFICATIONS = {"impaired": "impaired:lost=0.01:sim"}

CAMERA = """
import math, threading, time
from agvbench.adapters import FrameClock, MocapAdapter, MocapIdentity

class Camera(MocapAdapter):
    option_names = ("body",)
    def __init__(self, options):
        self.clock, self.closed, self.thread = options.clock, threading.Event(), None
    @classmethod
    def open(cls, address, options):
        return cls(options)
    def identity(self):
        return MocapIdentity(adapter="camera", rate_hz=100.0, simulated=False)
    def start(self, reports):
        self.reports = reports
        self.thread = threading.Thread(target=self.run, name="frames", daemon=True)
        self.thread.start()
    def run(self):
        number = 0
        while not self.closed.wait(0.01):
            number += 1
            self.publish(self.clock.now(), number)
    def publish(self, now_s, n):
        self.reports.frame(now_s, 1.0, 2.0, 0.5, clock=FrameClock.ADAPTER, frame=n, received_s=now_s)
    def close(self):
        self.closed.set()
        if self.thread is not None:
            self.thread.join()
"""
PUBLISH = "    def publish(self, now_s, n): self.reports.frame({}, clock=FrameClock.{}, frame={})\n"


def publish(values: str, clock: str = "ADAPTER", number: str = "n") -> str:
    return PUBLISH.format(values, clock, number)


def checked(source: str, folder: Path, watched_s: float = 0.3) -> dict[str, CheckResult]:
    """Return the results of a camera in a file, by name."""
    file = folder / "own.py"
    file.write_text(source, encoding="utf-8")
    results = {one.name: one for one in check_camera(str(file), AdapterOptions(), watched_s=watched_s)}
    assert all("\n" not in f"{one.found}{one.remedy}" for one in results.values())
    return results


@contextmanager
def reachable(scheme: str) -> Iterator[str]:
    """Give the specification of a shipped camera, with the stand-in of its server where there is one."""
    if scheme == "natnet":
        with natnet_server() as spec:
            yield spec
    else:
        yield SPECIFICATIONS.get(scheme, scheme)


@pytest.mark.parametrize("scheme", mocap_adapters())
def test_every_shipped_camera_keeps_the_contract(scheme: str) -> None:
    with reachable(scheme) as spec:
        results = list(check_camera(spec, AdapterOptions()))
    assert [result for result in results if not result.passed] == []
    assert {"options", "open", "identity", "close", "start", "frames", "poses", "clock"} <= {r.name for r in results}


def test_faults_do_not_hide_a_real_camera() -> None:
    with natnet_server() as spec:
        results = list(check_camera(f"impaired:frozen@1/20:{spec}", AdapterOptions(), watched_s=0.3))
    assert [result for result in results if not result.passed] == []


def test_a_camera_of_a_lab_keeps_the_contract(tmp_path: Path) -> None:
    results = checked(CAMERA, tmp_path)
    assert [result for result in results.values() if not result.passed] == []
    assert "% tracked, last pose x = 1.000 m, y = 2.000 m, heading 28.6°" in results["frames"].found


def test_a_hollow_camera_fails(tmp_path: Path) -> None:
    hollow = CAMERA + "    def identity(self): return 5\n    def start(self, reports): raise RuntimeError('boom')\n"
    results = checked(hollow, tmp_path)
    assert not results["identity"].passed
    assert results["identity"].found == "identity returns 5"
    assert results["close at start"].found == "raised RuntimeError: boom"
    assert results["close at start"].remedy.startswith("look at own.py, line")
    assert main(["mocap", str(tmp_path / "own.py"), "--check"]) == 1


@pytest.mark.parametrize(("breach", "name", "found"), [
    ("    def run(self): pass\n", "frames", "no frame within 3 s of start"),
    ("    def run(self): {}['x']\n", "frames", "frames: an exception ended a thread of the adapter: KeyError: 'x'"),
    (publish("now_s, math.nan, 0.0, 0.0"), "poses", "a tracked frame contains a pose that is not finite"),
    (publish("now_s, 1200.0, 0.0, 0.0"), "poses", "position of 1200 m (limit: 50 m)"),
    (publish("now_s, 1.0, 0.0, 90.0"), "poses", "heading of 90 rad (limit: 2π)"),
    (publish("now_s, math.nan, 0.0, 0.0, tracked=False"), "poses", "contains the vehicle"),
    (publish("7.0, 1.0, 0.0, 0.0"), "capture times", "capture times increase in 0 % of the frames (limit: 95 %)"),
    (publish("time.time(), 1.0, 0.0, 0.0"), "clock", "s after their capture (limit: -0.01 to 1 s)"),
    (publish("now_s, 1.0, 0.0, 0.0", "RUN"), "clock", "capture times are in FrameClock.RUN"),
    (publish("now_s, 1.0, 0.0, 0.0", number="3"), "frame numbers", "frame numbers increase in 0 % of the frames"),
    ("    def identity(self): return MocapIdentity('c', 240.0, False)\n", "rate", "nominal 240 Hz (limit: 0.8 to 1.25"),
    ("    def identity(self): return MocapIdentity('c', math.nan, False)\n", "identity", "frame rate is out of range"),
    ("    def identity(self): return MocapIdentity('c', 100, False, {'a': 5})\n", "identity", "cannot be decoded"),
    ("    def close(self): self.closed.set(); self.thread.join()\n", "close", "raised AttributeError: 'NoneType'"),
    ("    def close(self): pass\n", "close at start", "frames are reported after close returned"),
    ("    @classmethod\n    def check(cls, *_): pass\n", "options", "--camera no_such_option=1 is accepted"),
])  # fmt: skip
def test_each_breach_is_one_line(breach: str, name: str, found: str, tmp_path: Path) -> None:
    results = checked(CAMERA + breach, tmp_path)
    assert found in results[name].found
    assert not results[name].passed
    assert results[name].remedy or name in ("identity", "frames")


def test_a_start_that_does_not_return_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("agvbench.adapters.contract_checks.result.call.__defaults__", (0.3,))
    results = checked(CAMERA + "    def start(self, reports): threading.Event().wait(5.0)\n", tmp_path)
    assert results["start"].found == "start does not return (limit: 0.3 s)"
    assert results["close under way"].passed


def test_exit_codes_and_lines_of_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "own.py"
    file.write_text(CAMERA, encoding="utf-8")
    assert main(["mocap", str(file), "--check"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[:3]] == ["options", "open", "identity"]
    file.write_text(CAMERA + "    def run(self): pass\n", encoding="utf-8")
    assert main(["mocap", str(file), "--check"]) == 1
    said = capsys.readouterr().out
    assert "frames          failed  no frame within 3 s of start" in said
    assert "→ start the camera's stream" in said
    assert main(["mocap", str(tmp_path / "none.py"), "--check"]) == 2
    assert main(["mocap", str(file), "--check", "--camera", "bdy=1"]) == 2
    assert main(["mocap", "--check", "--emulate"]) == 2
    assert "--check: only an adapter can be checked" in capsys.readouterr().err


def test_an_option_that_a_camera_does_not_declare_is_one_line(tmp_path: Path) -> None:
    file = tmp_path / "own.py"
    file.write_text(CAMERA, encoding="utf-8")
    with pytest.raises(AgvbenchError) as caught:
        list(check_camera(str(file), AdapterOptions(camera={"bdy": "1"})))
    assert str(caught.value) == "--camera: not an option of the camera own: 'bdy' (one of: body); did you mean 'body'?"


def test_a_vehicle_is_checked_without_a_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["agv", "sim", "--check"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == [
        "open", "identity", "start", "stop", "close",
    ]  # fmt: skip
    file = tmp_path / "car.py"
    file.write_text(
        "from agvbench.adapters.agv.sim import SimAgv\n"
        "class Car(SimAgv):\n"
        "    scheme = 'car'\n"
        "    def apply(self, message): raise AssertionError('driven')\n"
        "    def identity(self): return 5\n"
        "    def stop(self): raise KeyError('radio')\n",
        encoding="utf-8",
    )
    results = {one.name: one for one in check_vehicle(str(file), AdapterOptions())}
    assert {name for name, one in results.items() if not one.passed} == {"identity", "stop"}
    assert results["stop"].found == "raised KeyError: 'radio'"


def test_no_thread_of_a_camera_is_left() -> None:
    before = threading.active_count()
    list(check_camera("natnet:emulated", AdapterOptions(), watched_s=0.2))
    assert threading.active_count() <= before
