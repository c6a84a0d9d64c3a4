"""The firmware in real time behind the adapter for real vehicles."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from agvbench.adapters import AdapterOptions
from agvbench.adapters.agv.serial import SerialAgv
from agvbench.adapters.serial_line import conversation
from agvbench.adapters.simavr.host import Pulse, SimavrHost
from agvbench.bus.command_message import CommandMessage
from agvbench.types import Command

pytestmark = pytest.mark.usefixtures("firmware")


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine that is busy may keep the simulated vehicle waiting, which is not what is tested."""
    monkeypatch.setattr(conversation, "ANSWER_LIMIT_S", 10.0)


class Silent:
    def event(self, *_: object, **__: object) -> None:
        """Nobody listens."""

    def truth(self, *_: object, **__: object) -> None:
        raise AssertionError


@contextmanager
def live(version: str) -> Iterator[SimavrHost]:
    host = SimavrHost(version, live=True)
    yield host
    host.close()


def pulses_until(host: SimavrHost, wanted_us: float) -> Pulse:
    """Read drive pulses until one is as wide as wanted."""
    while True:
        word, *numbers = host._line()
        assert word == "pulse"
        pulse = Pulse(*map(int, numbers))
        if pulse.channel == 0 and abs(pulse.width_us - wanted_us) <= 1.0:
            return pulse


@pytest.mark.parametrize(("version", "driven_us"), [("1", 1606.67), ("2", 1600.0)])
def test_the_serial_adapter_drives_the_firmware(version: str, driven_us: float) -> None:
    with live(version) as host:
        agv = SerialAgv.open(host.port, AdapterOptions())
        agv.start(Silent())
        try:
            assert agv.hello.firmware_version == int(version)
            agv.apply(CommandMessage(1, 0.0, Command(1600.0, 1500.0, 1500.0), 0.1))
            pulses_until(host, driven_us)
            agv.stop()
            pulses_until(host, 1500.0)
            agv.apply(CommandMessage(2, 0.0, Command(1600.0, 1500.0, 1500.0), 0.1))
            pulses_until(host, driven_us)
        finally:
            agv.close()


def test_a_vehicle_whose_host_is_gone_stops_itself() -> None:
    with live("2") as host:
        agv = SerialAgv.open(host.port, AdapterOptions())
        agv.start(Silent())
        agv.apply(CommandMessage(1, 0.0, Command(1600.0, 1500.0, 1500.0), 0.1))
        driven = pulses_until(host, 1600.0)
        agv.close()  # without a stop, as a host that was killed
        stopped = pulses_until(host, 1500.0)
        assert (stopped.rise - driven.rise) / 16e6 < 0.275
        # A second host finds a vehicle that already insists on checksums, and half a line of the first.
        again = SerialAgv.open(host.port, AdapterOptions())
        assert again.hello.firmware_version == 2
        again.close()
