"""A slow change of the drive for a reason that was not logged is no lag; estimates from earlier windows follow it."""

from __future__ import annotations

import pytest
from free_drives import FREE_HEADER, free_runs
from tiny_vehicle import InMemory, Tiny

from agvbench.diagnosis import diagnose


@pytest.mark.parametrize(
    ("truth", "named", "most"),
    [
        (Tiny(per_volt=0.15), set(), 0.6),
        pytest.param(Tiny(per_volt=0.1, accelerate_s=0.3, brake_s=0.3), {"speed_lag"}, 0.7, marks=pytest.mark.slow),
        pytest.param(
            Tiny(per_volt=0.15, delay_s=0.1, steering_lag_s=0.1), {"actuation_delay"}, 0.4, marks=pytest.mark.slow
        ),
    ],
    ids=["a supply", "a supply and a lag", "a supply, a delay and a lag of the steering"],
)
def test_a_drive_that_varies_slowly_is_no_lag(truth, named, most):
    said: list[str] = []
    found = diagnose(InMemory(free_runs(truth, sessions=3, runs=2), FREE_HEADER), on_progress=said.append)
    assert {effect.name for effect in found.effects} == named
    errors = found.held_out.errors["position_rms_mm"]
    assert errors["after"] < most * errors["before"]
    removed = [line for line in said if line.startswith("speed_lag predicts worse than parameters that vary: ")]
    assert len(removed) == ("speed_lag" not in named)
    assert ("speed_lag" in found.rejected) is bool(removed)
