"""Faults of the program that drives: exceptions and signals."""

import signal
from pathlib import Path

from fault_bench import Campaign
from fault_record import Fault, Then


def _raise(_: Path) -> None:
    raise RuntimeError("a mistake in the bench")


def _signal(number: signal.Signals) -> Campaign:
    return Campaign(do=lambda _: signal.raise_signal(number))


FAULTS = (
    Fault(
        "exception",
        "runner",
        "an exception during a run",
        Then.FAILS,
        Campaign(do=_raise),
        "a mistake in the bench",
        0.1,
    ),
    Fault("Ctrl-C", "runner", "SIGINT", Then.ENDS, _signal(signal.SIGINT), "KeyboardInterrupt", 0.1),
    Fault("SIGTERM", "runner", "SIGTERM", Then.ENDS, _signal(signal.SIGTERM), "Terminated SIGTERM", 0.1),
    Fault(
        "SIGHUP",
        "runner",
        "SIGHUP (a closed terminal)",
        Then.ENDS,
        _signal(signal.SIGHUP),
        "Terminated SIGHUP",
        0.1,
    ),
)
