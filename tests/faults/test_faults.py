"""Every fault: the vehicle stops in time, finished runs stay as they are, one line says why, and --resume works."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from fault_record import Fault, all_faults

from agvbench.adapters.simavr.firmware_files import why_not_built

pytestmark = pytest.mark.real_time

FAULTS = all_faults()


def test_there_are_many_faults_each_with_its_own_name() -> None:
    assert len({fault.name for fault in FAULTS}) == len(FAULTS) >= 40


@pytest.fixture(autouse=True)
def heard() -> Iterator[None]:
    """Hear signals that whatever started the tests has them ignore, as ``nohup`` does SIGHUP and ``&`` SIGINT."""
    heard = {signal.SIGINT: signal.default_int_handler, signal.SIGHUP: signal.SIG_DFL, signal.SIGTERM: signal.SIG_DFL}
    ignored = [number for number in heard if signal.getsignal(number) is signal.SIG_IGN]
    for number in ignored:
        signal.signal(number, heard[number])
    yield
    for number in ignored:
        signal.signal(number, signal.SIG_IGN)


@pytest.mark.parametrize(
    "fault", [fault for fault in FAULTS if fault.tested], ids=lambda fault: fault.name.replace(" ", "-")
)
def test_fault(fault: Fault, tmp_path: Path) -> None:
    # The farthest rig that the fault can befall; `benchmarks/perf/perf_faults.py` plays it on all.
    rig = fault.rigs[-1]
    if rig != "sim" and (why := why_not_built()):
        if len(fault.rigs) == 1:
            pytest.skip(why)
        rig = fault.rigs[0]
    # Real time is not measured where other programs run, too.
    slack = 5.0 if rig == "live" else 1.0
    assert fault.play(tmp_path, rig).breaks(fault, slack) == []
