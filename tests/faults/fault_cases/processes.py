"""Faults of the processes that share the loop: killed, suspended, or gone."""

import os
import signal
from functools import partial

from fault_live import PATIENT, Live, Orphaned, beside_a_slow_consumer, in_processes
from fault_record import Fault, Then
from lab_processes import Processes

from agvbench.running.supervision.limits import DEFAULT_SAFETY

_LIVE = ("live",)


def _sent(name: str, number: signal.Signals) -> Live:
    def befall(running: Processes) -> None:
        os.kill(getattr(running, name).pid, number)

    # Who kills the camera's process is to hear of that; who suspends it sees nothing more.
    limits = DEFAULT_SAFETY if (name, number) == ("mocap", signal.SIGSTOP) else PATIENT
    return Live(open=partial(in_processes, befall=befall), limits=limits)


FAULTS = (
    Fault(
        "slow consumer",
        "bus",
        "a subscriber receives all messages and reads none",
        Then.GOES_ON,
        Live(open=beside_a_slow_consumer, limits=PATIENT),
        rigs=_LIVE,
        tested=False,
    ),
    Fault(
        "vehicle killed",
        "bus",
        "the process of the vehicle's adapter is killed; the firmware's watchdog stops the vehicle",
        Then.STOPS,
        _sent("agv", signal.SIGKILL),
        "the agv adapter vanished",
        0.4,
        _LIVE,
        tested=False,
    ),
    Fault(
        "vehicle suspended",
        "bus",
        "the process of the vehicle's adapter hangs",
        Then.STOPS,
        _sent("agv", signal.SIGSTOP),
        "adapter does not answer any more",
        0.4,
        _LIVE,
    ),
    Fault(
        "camera killed",
        "bus",
        "the process of the camera's adapter is killed",
        Then.STOPS,
        _sent("mocap", signal.SIGKILL),
        "the mocap adapter vanished",
        0.75,
        _LIVE,
        tested=False,
    ),
    Fault(
        "camera suspended",
        "bus",
        "the process of the camera's adapter hangs",
        Then.RETRIES,
        _sent("mocap", signal.SIGSTOP),
        "tracking was lost",
        0.75,
        _LIVE,
        tested=False,
    ),
    Fault(
        "runner killed",
        "runner",
        "the driving program receives SIGKILL",
        Then.ENDS,
        Orphaned(signal.SIGKILL),
        "",
        0.4,
        _LIVE,
    ),
    Fault(
        "runner suspended",
        "runner",
        "the driving program is suspended",
        Then.ENDS,
        Orphaned(signal.SIGSTOP),
        "",
        0.4,
        _LIVE,
        tested=False,
    ),
)
