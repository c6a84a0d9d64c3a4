"""Faults in real time, with the real serial and NatNet adapters: the firmware, the port, the bodies."""

from functools import partial

from fault_live import PATIENT, Live, in_process
from fault_record import Fault, Then
from live_lab import OTHER, LiveLab

_LIVE = ("live",)


def _rename(lab: LiveLab) -> None:
    lab.body = OTHER


def _switch_off(lab: LiveLab) -> None:
    lab.streams = False


def _end(lab: LiveLab) -> None:
    lab.host.process.kill()


FAULTS = (
    Fault(
        "wrong id",
        "NatNet",
        "frames contain the id of another body",
        Then.RETRIES,
        Live(_rename),
        "tracking was lost",
        0.75,
        _LIVE,
        tested=False,
    ),
    Fault(
        "stream stopped",
        "NatNet",
        "the server stops sending frames",
        Then.RETRIES,
        Live(_switch_off),
        "tracking was lost",
        0.75,
        _LIVE,
        tested=False,
    ),
    Fault(
        "late description",
        "NatNet",
        "the server does not describe its rigid bodies",
        Then.REFUSES,
        Live(described=False, rest_s=2.0),
        "no rigid body is called",
        0.0,
        _LIVE,
        tested=False,
    ),
    Fault(
        "port pulled",
        "serial line",
        "the serial port is gone",
        Then.STOPS,
        Live(_end, limits=PATIENT),
        "the serial port is gone",
        0.3,
        _LIVE,
        tested=False,
    ),
    Fault(
        "line cut live",
        "serial line",
        "the line breaks, in real time",
        Then.STOPS,
        Live(open=partial(in_process, faults="cut"), limits=PATIENT),
        "the vehicle does not answer any more",
        0.4,
        _LIVE,
        tested=False,
    ),
    Fault(
        "adapter hangs",
        "adapter",
        "the vehicle's adapter does not return from a command",
        Then.STOPS,
        Live(open=partial(in_process, faults="hangs"), limits=PATIENT),
        "does not come back from a command",
        0.4,
        _LIVE,
    ),
)
