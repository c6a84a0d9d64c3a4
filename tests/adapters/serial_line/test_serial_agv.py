"""``serial:PORT`` over a real pseudo-terminal: everything that goes wrong on a serial line is one clear line."""

from __future__ import annotations

import os
import pty
import re
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from msgspec.structs import replace
from scripted_vehicle import HELLO, ScriptedVehicle, with_checksum

from agvbench.adapters import AdapterOptions
from agvbench.adapters.agv import serial as module
from agvbench.adapters.agv.serial import SerialAgv
from agvbench.adapters.registry import open_agv
from agvbench.adapters.serial_line import conversation
from agvbench.adapters.serial_line.port import SerialPort
from agvbench.bus.clock import WallClock
from agvbench.bus.messages.codec import encode
from agvbench.bus.messages.command import CommandMessage
from agvbench.bus.messages.event import Level
from agvbench.bus.messages.identity import decode_agv_identity
from agvbench.errors import AgvbenchError, LinkError
from agvbench.types import Command
from agvbench.vehicle.channels import Channels

pytestmark = pytest.mark.real_time

FORWARD = CommandMessage(1, 0.0, Command(1600.4, 1400.0, 1500.0), 0.1)


class Events:
    def __init__(self) -> None:
        self.heard: list[tuple[Level, str, str]] = []
        self.changed = threading.Condition()

    def event(self, level: Level, kind: str, text: str, *, acknowledged: int = 0) -> None:
        with self.changed:
            self.heard.append((level, kind, text))
            self.changed.notify_all()

    def failed(self, error: Exception, *, acknowledged: int = 0) -> None:
        self.event(Level.ERROR, type(error).__name__, str(error))

    def truth(self, *_: object, **__: object) -> None:
        raise AssertionError

    def wait_for(self, kind: str, number: int = 1) -> str:
        with self.changed:
            enough = self.changed.wait_for(lambda: len(self.texts(kind)) >= number, timeout=10.0)
        assert enough, self.heard
        return self.texts(kind)[number - 1]

    def texts(self, kind: str) -> list[str]:
        return [text for _, name, text in self.heard if name == kind]


@contextmanager
def connected(vehicle: ScriptedVehicle, **options: object) -> Iterator[tuple[SerialAgv, Events]]:
    with vehicle:
        agv, events = open_agv(f"serial:{vehicle.port}", AdapterOptions(**options)), Events()  # type: ignore[arg-type]
        assert isinstance(agv, SerialAgv)
        agv.start(events)
        try:
            yield agv, events
        finally:
            agv.stop()
            agv.close()


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ask who is there more often than in a lab, and wait longer for answers: the machine may be busy."""
    monkeypatch.setattr(module, "_ATTEMPT_S", 0.1)
    monkeypatch.setattr(conversation, "ANSWER_LIMIT_S", 1.0)


def test_commands_are_sent_and_stop_is_neutral() -> None:
    vehicle = ScriptedVehicle()
    with connected(vehicle) as (agv, events):
        identity = agv.identity()
        assert decode_agv_identity(encode(identity)) == identity
        assert (identity.firmware, identity.simulated, identity.extra["firmware_calibration"]) == (
            "agvbench 2",
            False,
            "0123abcd",
        )
        agv.apply(FORWARD)
        assert vehicle.wait_for("S 1 1600 1400 1500")
        agv.stop()
        assert vehicle.wait_for("S 2 1500 1500 1500")
    assert events.heard == []


def test_version_1_is_told_whole_degrees_and_no_checksum() -> None:
    def answer(text: str) -> bytes:
        return b"V agvbench 1 1 deg none\n" if text == "V" else b"err 0 1\n" if text[0] == "V" else b"ok 1\n"

    vehicle = ScriptedVehicle(lambda text: answer(text) if text else b"err 0 1\n")
    with connected(vehicle) as (agv, _):
        agv.apply(FORWARD)
        assert vehicle.wait_for("S 1 98 82 90")


def test_a_reset_on_open_half_a_line_and_noise_before_the_banner_are_waited_out() -> None:
    booted = threading.Event()
    vehicle = ScriptedVehicle(lambda text: ScriptedVehicle.obey(text) if booted.is_set() else b"")
    vehicle.set_command(b"ok 3\xff\x00\x17boot\r\nok 41")

    def boot() -> None:
        vehicle.set_command(b"2\n" + HELLO.encode() + b"\n")
        booted.set()

    timer = threading.Timer(0.3, boot)
    timer.start()
    with connected(vehicle) as (agv, _):
        assert agv.hello.calibration_hash == "0123abcd"
    timer.join()


def foreign(line: bytes) -> Callable[[str], bytes]:
    return lambda _: line


@pytest.mark.parametrize(
    ("answer", "line"),
    [
        (foreign(b""), "the vehicle does not answer; see whether it is switched on"),
        (foreign(b"Grbl 1.1f ['$' for help]\r\n"), 'this is not the firmware of a model AGV: "Grbl 1.1f'),
        (foreign(b"noise without end "), "this is not the firmware of a model AGV: "),
        (foreign(b"V agvbench 9 1 us none\n"), "firmware that this agvbench does not know: firmware 9, protocol 1, us"),
        (foreign(b"V agvbench 2 7 us none\n"), "protocol 7"),
        (foreign(b"V agvbench 2 1 deg none\n"), "that this agvbench does not know"),
    ],
)
def test_whoever_else_is_there_is_one_line(
    answer: Callable[[str], bytes], line: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "GREETING_LIMIT_S", 1.0)
    with ScriptedVehicle(answer) as vehicle, pytest.raises(LinkError) as caught:
        open_agv(f"serial:{vehicle.port}", AdapterOptions())
    assert line in str(caught.value)
    assert vehicle.port in str(caught.value)
    assert "\n" not in str(caught.value)


def with_answers(*answers: bytes) -> Callable[[str], bytes]:
    """Greet, then give the answers one after the other, the last for ever."""
    left = list(answers)

    def answer(text: str) -> bytes:
        if not text.startswith("S "):
            return ScriptedVehicle.obey(text)
        return left.pop(0) if len(left) > 1 else left[0]

    return answer


@pytest.mark.parametrize(
    ("answer", "line"),
    [
        (with_checksum(HELLO), "the vehicle was reset while it was driven"),
        (with_checksum("err 1 3"), "the vehicle refused a line: a number is out of its range: err 1 3"),
        (with_checksum("err 0 7"), "checksum is wrong or missing: err 0 7 (limit: 3 in a row); see the cable"),
        (b"", "the vehicle does not answer any more: command 1 for"),
        (b"ok 1\n", "the vehicle does not answer any more"),  # without its checksum it may be anything
    ],
)
def test_what_goes_wrong_while_driving_is_one_line_and_stays(answer: bytes, line: str) -> None:
    vehicle = ScriptedVehicle(with_answers(answer))
    with connected(vehicle) as (agv, events):
        agv.apply(FORWARD)
        assert line in events.wait_for("LinkError")
        with pytest.raises(LinkError) as caught:
            agv.apply(FORWARD)
        assert line in str(caught.value)
        assert vehicle.wait_for("1500 1500 1500")


class Suspended(WallClock):
    """The clock of a process that is suspended for 5 s, once."""

    def __init__(self) -> None:
        self.offset_s = 0.0

    def now(self) -> float:
        return time.monotonic() + self.offset_s


def test_a_process_that_was_suspended_before_it_read_the_answer_blames_no_vehicle() -> None:
    vehicle, clock = ScriptedVehicle(), Suspended()
    with connected(vehicle, clock=clock) as (agv, events):
        plain, reads = agv.line.read, []

        def read() -> bytes:
            if not reads and vehicle.wait_for("S 1"):
                time.sleep(0.05)  # the answer comes after the read has ended with nothing
                clock.offset_s = 5.0
                reads.append(b"")
                return b""
            reads.append(plain())
            return reads[-1]

        agv.line.read = read  # type: ignore[method-assign]
        agv.apply(FORWARD)
        while len(reads) < 4 and not events.heard:
            time.sleep(0.01)
        assert events.heard == []


def test_noise_on_the_way_to_the_vehicle_is_made_good_and_told() -> None:
    vehicle = ScriptedVehicle(with_answers(with_checksum("err 0 7"), with_checksum("ok 2")))
    with connected(vehicle) as (agv, events):
        agv.apply(FORWARD)
        assert vehicle.wait_for("S 2 1600 1400 1500")
        events.wait_for("command_resent")
        agv.apply(FORWARD)


def test_noise_on_the_way_back_is_told_and_moves_on() -> None:
    vehicle = ScriptedVehicle(with_answers(b"ok\x80 1*0000\n" + with_checksum("ok 1")))
    with connected(vehicle) as (agv, events):
        agv.apply(FORWARD)
        events.wait_for("line_garbled")
        for number in (1, 2):  # every one is told, for each spoils a run
            vehicle.set_command(with_checksum("W"))
            said = events.wait_for("vehicle_stopped_itself", number)
        assert re.fullmatch(
            r"the vehicle's watchdog stopped it: \d\.\d\d s between two commands \(limit: 0.25 s\)", said
        )
        agv.apply(FORWARD)


def test_a_cable_that_is_pulled_is_one_line() -> None:
    vehicle = ScriptedVehicle()
    with connected(vehicle) as (agv, events):
        vehicle.unplug()
        assert "the serial port is gone; plug the vehicle in again" in events.wait_for("LinkError")
        with pytest.raises(LinkError, match="serial port is gone"):
            agv.apply(FORWARD)


def test_a_board_that_takes_no_more_bytes_is_not_a_cable_that_was_pulled() -> None:
    near, far = pty.openpty()
    tty.setraw(far)
    port = SerialPort(os.ttyname(far))
    with pytest.raises(LinkError, match=r"the vehicle takes no more bytes: waited 0.2 s; see whether its program"):
        port.write(bytes(1_000_000))
    port.close()
    os.close(near)
    os.close(far)


def test_a_command_out_of_range_is_refused_here_and_breaks_nothing() -> None:
    vehicle = ScriptedVehicle()
    with connected(vehicle) as (agv, _):
        with pytest.raises(LinkError, match=r"front pulse is out of what the firmware takes: 2500 µs"):
            agv.apply(replace(FORWARD, command=Command(1500.0, 2500.0, 1500.0)))
        agv.apply(FORWARD)
        assert vehicle.wait_for("1600 1400 1500")


def test_ports_that_cannot_be_opened(tmp_path: Path) -> None:
    plain = tmp_path / "plain"
    plain.touch()
    cases = {
        "serial": "which serial port?; write serial:/dev/ttyACM0",
        "serial:/dev/nowhere": "/dev/nowhere: no such serial port; plug the vehicle in",
        f"serial:{plain}": "not a serial port",
        f"serial:{tmp_path}": "serial port cannot be opened",
    }
    for spec, line in cases.items():
        with pytest.raises(AgvbenchError) as caught:
            open_agv(spec, AdapterOptions())
        assert line in str(caught.value)
        assert "\n" not in str(caught.value)
    with pytest.raises(LinkError, match="takes microseconds"):
        open_agv("serial:/dev/nowhere", AdapterOptions(channels=Channels.alike("normalised")))
    with pytest.raises(
        LinkError, match=r"watchdog stops the drive at another pulse: neutral 1480 µs \(limit: 1500 µs\)"
    ):
        open_agv("serial:/dev/nowhere", AdapterOptions(channels=Channels.alike("us", 1480.0)))


def test_a_port_that_is_in_use_says_so() -> None:
    vehicle = ScriptedVehicle()
    with connected(vehicle), pytest.raises(LinkError, match="in use"):
        open_agv(f"serial:{vehicle.port}", AdapterOptions())
