"""A session plans with what is known of the corrected vehicle: what it still misses, and how long it has driven."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from agvbench.effects.electronics.battery_droop import BatteryDroop
from agvbench.effects.ground.lateral_slip import LateralSlip
from agvbench.model import thesis_vehicle
from agvbench.planning import Departure, Workspace, corrected_plan, load_trajectory
from agvbench.running.session.session import BenchSession
from agvbench.types import Pose

FLOOR = Workspace.parse("circle:6.1")
MISSED = {"5": Pose(0.01, -0.02, 0.03)}


@dataclass
class Later:
    """A bench, as far as plans look at it: when the next run begins, and the corrected model."""

    corrected: object
    departure: Departure

    def model(self, _: str) -> object:
        return self.corrected

    def check(self) -> None:
        """It drives on."""


def session(tmp_path, model, bench=None, bias_corrections=MISSED):
    models = {"uncalibrated": thesis_vehicle(), "calibrated": thesis_vehicle(), "corrected": model}
    return BenchSession(tmp_path, models=models, workspace=FLOOR, bench=bench, bias_corrections=bias_corrections)


def same(a, b):
    return all(np.array_equal(x, y) for x, y in zip(vars(a.commands).values(), vars(b.commands).values(), strict=True))


def test_aims_are_moved_by_what_the_model_is_known_to_miss(tmp_path):
    model = thesis_vehicle().with_effects(LateralSlip(0.5))
    five, one = load_trajectory("5"), load_trajectory("1")
    made = session(tmp_path, model)
    assert same(made.plan(five, "corrected"), corrected_plan(five, model, workspace=FLOOR, end_pose_bias=MISSED["5"]))
    assert not same(made.plan(five, "corrected"), session(tmp_path, model, bias_corrections={}).plan(five, "corrected"))
    assert same(made.plan(one, "corrected"), corrected_plan(one, model, workspace=FLOOR))


@pytest.mark.parametrize(("effect", "anew"), [(BatteryDroop(0.2), True), (LateralSlip(0.5), False)])
def test_a_plan_is_made_anew_only_where_the_hour_matters(tmp_path, effect, anew):
    model, five = thesis_vehicle().with_effects(effect), load_trajectory("5")
    bench = Later(model, Departure(started_h=0.0))
    made = session(tmp_path, model, bench)
    at_once = made.plan(five, "corrected")
    bench.departure = replace(bench.departure, started_h=0.5)
    later = made.plan(five, "corrected")
    assert (later is at_once) is not anew
    assert same(later, at_once) is not anew
