"""The campaign's clock goes on steadily, whatever is done to the clock of the machine."""

from __future__ import annotations

import pytest

from agvbench.running.execution.campaign_time import WallCampaignTime


class Machine:
    def __init__(self) -> None:
        self.wall_s, self.steady_s = 1_000_000.0, 5.0

    def passes(self, duration_s: float) -> None:
        self.wall_s += duration_s
        self.steady_s += duration_s

    def opened(self, last_s: float = 0.0) -> WallCampaignTime:
        return WallCampaignTime(1_000_000.0, last_s, wall=lambda: self.wall_s, steady=lambda: self.steady_s)


@pytest.mark.parametrize("step_s", [-3600.0, 3600.0])
def test_a_clock_that_is_set_in_a_session_does_not_move_its_runs(step_s: float) -> None:
    machine = Machine()
    time = machine.opened()
    machine.passes(10.0)
    machine.wall_s += step_s
    machine.passes(10.0)
    assert time.now_s() == pytest.approx(20.0)


def test_a_session_resumes_after_the_last_run_even_if_the_clock_was_set_back() -> None:
    machine = Machine()
    machine.passes(60.0)
    assert machine.opened(last_s=50.0).now_s() == pytest.approx(60.0)
    machine.wall_s -= 3600.0
    resumed = machine.opened(last_s=50.0)
    assert resumed.now_s() == pytest.approx(50.0)
    machine.passes(2.0)
    assert resumed.now_s() == pytest.approx(52.0)
