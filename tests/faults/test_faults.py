"""Every fault: the vehicle stops in time, finished runs stay as they are, one line says why, and --resume works."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from fault_record import Fault, Then, all_faults

from agvbench.adapters.simavr.built import why_not_built

FAULTS = all_faults()


def cases() -> Iterator[object]:
    for fault in FAULTS:
        marks = [pytest.mark.slow] if fault.slow else []
        yield pytest.param(fault, id=fault.name.replace(" ", "-"), marks=marks)


def test_there_are_many_faults_each_with_its_own_name() -> None:
    assert len({fault.name for fault in FAULTS}) == len(FAULTS) >= 25


@pytest.mark.parametrize("fault", list(cases()))
def test_fault(fault: Fault, tmp_path: Path) -> None:
    # The farthest rig that the fault can befall; `benchmarks/perf/perf_faults.py` plays it on all.
    rig = fault.rigs[-1]
    if rig == "simavr" and (why := why_not_built()):
        if len(fault.rigs) == 1:
            pytest.skip(why)
        rig = fault.rigs[0]
    outcome = fault.play(tmp_path, rig)
    assert fault.message in outcome.said
    assert "\n" not in outcome.said + outcome.later
    if fault.limit_s is not None:
        assert outcome.reaction_s is not None
        assert outcome.reaction_s <= fault.limit_s
    if fault.then is Then.STOPS:
        assert outcome.later.startswith("the bench drives no more after the first failure: ")
        assert outcome.said in outcome.later
    elif fault.then is not Then.REJECTS:
        assert outcome.later == ""
    assert outcome.intact
    assert outcome.resumed
