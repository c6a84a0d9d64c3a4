"""Faults in real time: one run through the real adapters, watched as in a bench, with a fault in its middle."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from fault_record import Outcome
from lab_processes import Processes, processes, runner, slow_consumer
from live_lab import LiveLab, live_lab

from agvbench.adapters import open_rig
from agvbench.bus.clock import WallClock
from agvbench.bus.link import VehicleLink
from agvbench.errors import AgvbenchError
from agvbench.planning import Workspace
from agvbench.running.execution.drive import Timing, drive
from agvbench.running.supervision.limits import DEFAULT_SAFETY, SafetyLimits
from agvbench.running.supervision.supervisor import Supervisor
from agvbench.types import Command, Commands, Pose

NEUTRAL = Command(1500.0, 1500.0, 1500.0)
START = Pose(0.0, 0.0, 0.0)
FROM_S, HOLD_S = 0.6, 2.6
_AFTERWARDS_S = 0.4
PATIENT = SafetyLimits(lost_s=5.0, frozen_s=5.0)
"""For faults that have nothing to do with the camera: a machine that is busy may not show it for a while."""
_TIMING = Timing(settle_s=0.2, settle_limit_s=0.2)
_COMMANDS = Commands(*np.array([[0.0, HOLD_S], [1700.0, 1500.0], [1500.0, 1500.0], [1500.0, 1500.0]]))


@contextmanager
def in_process(lab: LiveLab, faults: str = "") -> Iterator[VehicleLink]:
    """Open the adapters of `lab` in this process."""
    _, port = lab.server.address
    agv = f"impaired:{faults}@{FROM_S}:serial:{lab.host.port}" if faults else f"serial:{lab.host.port}"
    with open_rig(agv=agv, mocap=f"natnet:127.0.0.1:{port}") as link:
        yield link


@contextmanager
def in_processes(lab: LiveLab, befall: Callable[[Processes], None]) -> Iterator[VehicleLink]:
    """Open each adapter of `lab` in a process of its own; `befall` does what it does to them."""
    with processes(lab) as running, open_rig(connect=running.endpoints) as link:
        lab.befall = lambda: befall(running)
        yield link


@contextmanager
def beside_a_slow_consumer(lab: LiveLab) -> Iterator[VehicleLink]:
    """Open the adapters in processes, while somebody else listens to all they say and never takes it."""
    with processes(lab) as running, slow_consumer(running.endpoints), open_rig(connect=running.endpoints) as link:
        yield link


@dataclass(frozen=True)
class Live:
    """How to play a fault in real time: what to `do` with the lab in the middle of a run, and how the rig is opened.

    What becomes of a campaign is played in lock step: the bench does not know which of the two it drives in.
    """

    do: Callable[[LiveLab], None] = lambda _: None
    open: Callable[[LiveLab], AbstractContextManager[VehicleLink]] = in_process
    described: bool = True
    rest_s: float = 0.3
    limits: SafetyLimits = DEFAULT_SAFETY

    def __call__(self, directory: Path, rig: str) -> Outcome:
        """Play the fault; return what came of it."""
        with live_lab(described=self.described) as lab:
            struck_s: list[float] = []
            opened_s = WallClock.now()
            with self.open(lab) as link:
                _trip(link, lambda: (struck_s.append(WallClock.now()), self.do(lab), lab.befall()))
                said = _driven(link, self.rest_s, self.limits)
                time.sleep(_AFTERWARDS_S)
                began_s = struck_s[0] if struck_s else opened_s
                reaction_s = max(0.0, lab.last_driven_s - began_s) if said else None
        return Outcome(reaction_s, said)


def _driven(link: VehicleLink, rest_s: float, limits: SafetyLimits) -> str:
    supervisor = Supervisor(Workspace.circle(12.0), NEUTRAL, limits)
    try:
        drive(
            link,
            _COMMANDS,
            neutral=NEUTRAL,
            start=START,
            run_key=None,
            supervisor=supervisor,
            timing=replace(_TIMING, rest_before_s=rest_s),
        )
    except AgvbenchError as error:
        return str(error)
    return ""


def _trip(link: VehicleLink, do: Callable[[], Any]) -> None:
    plain, done = link.control_cycle, [False]

    def control_cycle(*args: Any, **keywords: Any) -> Any:
        if not done[0] and keywords["t_s"] >= FROM_S - 1e-9:
            done[0] = True
            do()
        return plain(*args, **keywords)

    link.control_cycle = control_cycle  # type: ignore[method-assign]


@dataclass(frozen=True)
class Orphaned:
    """How to play what befalls the runner: it is a process of its own, and `number` is what it is sent."""

    number: signal.Signals

    def __call__(self, directory: Path, rig: str) -> Outcome:
        """Play the fault; nobody is left to say anything."""
        with live_lab() as lab, processes(lab) as running, runner(running.endpoints) as driving:
            struck_s = WallClock.now()
            driving.send_signal(self.number)
            time.sleep(1.0)
            return Outcome(max(0.0, lab.last_driven_s - struck_s), "")
