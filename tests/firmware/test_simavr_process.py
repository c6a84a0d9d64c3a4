"""The simulated microcontroller is a process: it may end, and it must end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

from agvbench.adapters import AdapterOptions, open_rig
from agvbench.adapters.agv.simavr import SimavrAgv
from agvbench.adapters.simavr.microcontroller import Microcontroller
from agvbench.errors import AdapterGoneError
from agvbench.types import Command, Pose

pytestmark = [pytest.mark.real_time, pytest.mark.usefixtures("firmware")]


def test_a_process_that_was_killed_is_one_line_every_time(version_2: Microcontroller) -> None:
    version_2.host.process.kill()
    version_2.host.process.wait()
    for _ in range(3):
        with pytest.raises(AdapterGoneError, match="simavr: the simulated microcontroller has ended") as caught:
            version_2.run_until(1.0)
        assert "\n" not in str(caught.value)


def test_an_order_that_nobody_understands_ends_it_with_its_reason(version_2: Microcontroller) -> None:
    with pytest.raises(AdapterGoneError, match="has ended: simavr_host: no such order"):
        version_2.host._order("dance")


def test_the_runner_hears_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[SimavrAgv] = []
    begin = SimavrAgv.__init__

    def remember(self: SimavrAgv, plant: object, options: AdapterOptions, *more: object) -> None:
        begin(self, plant, options, *more)  # type: ignore[arg-type]
        opened.append(self)

    monkeypatch.setattr(SimavrAgv, "__init__", remember)
    with open_rig(agv="simavr") as link:
        link.reset(Pose(0.0, 0.0, 0.0), run_key="a")
        link.control_cycle(Command(1600.0, 1500.0, 1500.0), t_s=0.0, hold_s=0.1)
        opened[0]._controller.host.process.kill()
        with pytest.raises(AdapterGoneError, match="simulated microcontroller has ended"):
            link.control_cycle(Command(1600.0, 1500.0, 1500.0), t_s=0.1, hold_s=0.1)


def test_no_process_outlives_a_bench_that_was_killed() -> None:
    program = (
        "import time; from agvbench.adapters.simavr.microcontroller import Microcontroller;"
        "print(Microcontroller().host.process.pid, flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as bench:
        assert bench.stdout is not None
        pid = int(bench.stdout.readline())
        os.kill(pid, 0)
        bench.send_signal(signal.SIGKILL)
        bench.wait()
    for _ in range(500):
        if not _runs(pid):
            return
        time.sleep(0.02)
    pytest.fail("the simulated microcontroller still runs")


def _runs(pid: int) -> bool:
    """Whether a process is there that has not ended; one that nobody has waited for does not count."""
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii") as stat:  # noqa: PTH123
            return stat.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
