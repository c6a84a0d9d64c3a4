"""The firmware in real time behind the adapter for real vehicles."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from agvbench.adapters import AdapterOptions, open_rig
from agvbench.adapters.agv import serial
from agvbench.adapters.agv.serial import SerialAgv
from agvbench.adapters.serial_line import conversation
from agvbench.adapters.simavr.host import Pulse, SimavrHost
from agvbench.bus.messages.command import CommandMessage
from agvbench.campaign import Campaign
from agvbench.errors import AgvbenchError, LinkError
from agvbench.running.session.opening import open_session
from agvbench.types import Command, Frames, Pose

pytestmark = [pytest.mark.real_time, pytest.mark.usefixtures("firmware")]


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine that is busy may keep the simulated vehicle waiting, which is not what is tested."""
    monkeypatch.setattr(conversation, "ANSWER_LIMIT_S", 10.0)
    monkeypatch.setattr(serial, "GREETING_LIMIT_S", 30.0)


class Silent:
    def event(self, *_: object, **__: object) -> None:
        """Nobody listens."""

    def failed(self, *_: object, **__: object) -> None:
        """Nobody listens."""

    def truth(self, *_: object, **__: object) -> None:
        raise AssertionError


@contextmanager
def live(version: str) -> Iterator[SimavrHost]:
    host = SimavrHost(version, live=True)
    try:
        yield host
    finally:
        host.close()


def pulses_until(host: SimavrHost, wanted_us: float) -> Pulse:
    """Read drive pulses until one is as wide as wanted."""
    return next(pulse for pulse in host.pulses() if pulse.channel == 0 and abs(pulse.width_us - wanted_us) <= 1.0)


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


HOST_TO_KILL = """
import sys, time
from agvbench.adapters import AdapterOptions
from agvbench.adapters.agv.serial import SerialAgv
from agvbench.bus.messages.command import CommandMessage
from agvbench.types import Command

agv = SerialAgv.open(sys.argv[1], AdapterOptions())
for number in range(1, 1000):
    agv.apply(CommandMessage(number, 0.0, Command(1600.0, 1500.0, 1500.0), 0.1))
    time.sleep(0.05)
"""


@pytest.mark.parametrize("version", ["1", "2"])
def test_a_host_that_was_killed_is_noticed_by_version_2_alone(version: str) -> None:
    driven_us = {"1": 1606.67, "2": 1600.0}[version]
    with live(version) as host, subprocess.Popen([sys.executable, "-c", HOST_TO_KILL, host.port]) as killed:
        pulses_until(host, driven_us)
        killed.kill()
        killed.wait()
        pulses = (pulse for pulse in host.pulses() if pulse.channel == 0)
        # As many frames as one second has, on the firmware's own clock.
        after = [next(pulses).width_us for _ in range(50)]
    assert (after[-1] == pytest.approx(1500.0, abs=1.0)) is (version == "2")
    assert after[0] == pytest.approx(driven_us, abs=1.0)


def test_a_campaigns_link_drives_the_firmware_in_real_time() -> None:
    start, perfect = Pose(0.5, 0.0, 0.0), dict.fromkeys(("lost", "doubled", "late", "wrong", "untracked"), 0.0)
    with open_rig("simavr-live:2", camera=perfect) as link:
        identity = link.identity()
        assert identity.simulated
        assert not identity.lock_step
        assert identity.agv.extra["firmware_unit"] == "us"
        for key in ("a", "b"):
            link.reset(start, run_key=key)
            rest = link.control_cycle(Command(1500.0, 1500.0, 1500.0), t_s=-0.2, hold_s=0.2)
            at_rest_m = rest.x_m[rest.t_s > -0.15]  # frames of before it was placed may come late
            assert np.all(np.abs(at_rest_m - start.x_m) < 0.01)
            for index in range(40):  # a busy machine may be late with pulses, frames and all else
                seen = link.control_cycle(Command(900.0, 1500.0, 1500.0), t_s=0.25 * index, hold_s=0.25)
                if np.any(seen.x_m - start.x_m > 0.03):
                    break
            else:
                pytest.fail("the vehicle did not move")


def test_a_run_in_which_the_firmwares_watchdog_bit_is_rejected_with_both_figures(tmp_path: Path) -> None:
    given = {
        "agv": "simavr-live",
        "vehicle": "",
        "attempts": 1,
        "camera": "lost=0,doubled=0,late=0,wrong=0,untracked=0",
    }
    with open_session(given, out=str(tmp_path / "c"), resume=False, dry_run=False) as session:
        assert session._bench is not None
        link = session._bench.link
        plain, stalls_s = link.control_cycle, [0.4]

        def control_cycle(command: Command, *, t_s: float, hold_s: float) -> Frames:
            if command.drive != 1500.0 and t_s > 0.7 and stalls_s:
                time.sleep(stalls_s.pop())
            return plain(command, t_s=t_s, hold_s=hold_s)

        link.control_cycle = control_cycle  # type: ignore[method-assign]
        with pytest.raises(AgvbenchError, match="no attempt counted"):
            session.driver("stalled", experiment="free", repeat=1).hold(for_s=0.8, drive=0.5)
    campaign = Campaign.open(tmp_path / "c")
    status = campaign.run("stalled").status
    assert re.match(
        r"rejected: \d\.\d\d s between two commands \(limit: 0.25 s, then the vehicle stops itself\)", status
    )
    [bite] = campaign.table("events").query("event == 'vehicle_stopped_itself'")["text"]
    assert re.fullmatch(r"the vehicle's watchdog stopped it: \d\.\d\d s between two commands \(limit: 0.25 s\)", bite)


def test_a_microcontroller_that_dies_while_it_is_driven_stops_the_run() -> None:
    with open_rig("simavr-live") as link:
        link.reset(Pose(0.0, 0.0, 0.0), run_key="a")
        link.control_cycle(Command(900.0, 1500.0, 1500.0), t_s=0.0, hold_s=0.2)
        [pid] = _children("simavr_host")
        os.kill(pid, signal.SIGKILL)
        with pytest.raises(LinkError, match="serial port is gone"):
            link.control_cycle(Command(900.0, 1500.0, 1500.0), t_s=0.2, hold_s=5.0)


def _children(name: str) -> list[int]:
    """Return the processes of this name that this one has started."""
    said = subprocess.run(["pgrep", "-P", str(os.getpid()), name], capture_output=True, text=True, check=False)
    return [int(line) for line in said.stdout.split()]
