"""A real vehicle is waited for: here one that moves in real time, and is put down by software."""

from __future__ import annotations

import pytest

from agvbench.adapters import open_rig
from agvbench.errors import LinkError
from agvbench.running.placing import wait_for_start
from agvbench.types import Command, Pose

pytestmark = pytest.mark.real_time

NEUTRAL = Command(1500.0, 1500.0, 1500.0)
START = Pose(0.5, -0.5, 1.0)


def test_a_run_begins_when_the_vehicle_stands_at_its_start() -> None:
    told: list[str] = []
    with open_rig("live", seed=1) as link:
        link.reset(Pose(0.2, -0.1, 1.1), run_key="a")

        def put_down_when_told(text: str) -> None:
            told.append(text)
            link.reset(START, run_key="b")

        wait_for_start(link, NEUTRAL, START, patience_s=20.0, tell=put_down_when_told)
    assert len(told) == 1
    assert told[0].startswith("put agv1 at x = 0.500 m, y = -0.500 m, heading 57.3°: it is 500 mm and 5.7° off")


def test_patience_ends() -> None:
    with open_rig("live", seed=1) as link:
        link.reset(Pose(0.5, -0.45, 1.0), run_key="a")
        with pytest.raises(LinkError, match=r"was not put at the start: it is 50 mm and 0.\d° off \(limit: 1 s\)"):
            wait_for_start(link, NEUTRAL, START, patience_s=1.0, tell=lambda _: None)
