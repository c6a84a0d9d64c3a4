"""What is concluded from errors, floors and dependences, told by hand."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from agvbench.diagnosis.conclusion import _held_out, _verdict
from agvbench.diagnosis.criteria import RESIDUAL
from agvbench.diagnosis.free_driving.conclusion import _above
from agvbench.diagnosis.free_driving.conclusion import _verdict as verdict_of_windows
from agvbench.diagnosis.residuals.covariate_test import RANDOM_PHASE, Dependence
from agvbench.diagnosis.residuals.residuals import MEDIAN, QUANTITIES, PoseResiduals
from agvbench.diagnosis.result import HeldOut, NamedEffect, Verdict
from agvbench.diagnosis.selection.validation import Assessment

FLOOR = dict.fromkeys((*QUANTITIES, MEDIAN), 2.0)  # mm, degrees
PATCH = Dependence("x_m", "speed", 1e-6, 0.3)


@dataclass
class Kept:
    """Readings, as far as they are looked at."""

    group: np.ndarray
    runs: list[SimpleNamespace]

    def __len__(self) -> int:
        return len(self.runs)


def off_by(*position_m: float) -> PoseResiduals:
    """Return what runs miss that are off ahead by as much, in each of three frames."""
    path = np.zeros((len(position_m), 3, 3))
    path[..., 0] = np.array(position_m)[:, None]
    nothing = np.zeros(len(position_m))
    return PoseResiduals(path, np.ones(path.shape[:2], dtype=bool), nothing, nothing)


def assessment(after_floors: float, lack_of_fit: float | None) -> Assessment:
    after = off_by(*[2e-3 * after_floors] * 4)
    return Assessment(after, after, FLOOR, FLOOR, lack_of_fit)


@pytest.mark.parametrize(
    ("after_floors", "lack_of_fit", "lacks"),
    [(2.0, 1e-4, True), (2.0, 0.5, False), (2.0, None, False), (1.1, 1e-6, False)],
)
def test_what_lacks_is_above_the_floor_and_beyond_scatter(after_floors, lack_of_fit, lacks):
    assert assessment(after_floors, lack_of_fit).has_lack_of_fit is lacks


@pytest.mark.parametrize(
    ("effects", "significant", "rest", "verdict", "why"),
    [
        ((), False, [], Verdict.ADEQUATE, "with refitted maps"),
        ((NamedEffect("steering_lag", {}, (), {}),), False, [], Verdict.NAMED, "with the named effects"),
        ((NamedEffect("steering_lag", {}, ("mocap_latency",), {}),), False, [], Verdict.AMBIGUOUS, "equally well"),
        ((NamedEffect("steering_lag", {}, (), {}),), True, [PATCH], Verdict.UNKNOWN, "depends on x_m"),
        ((), True, [], Verdict.UNKNOWN, "none of the covariates"),
        ((), True, [Dependence(RANDOM_PHASE, "speed", 1e-3, 0.5)], Verdict.UNKNOWN, "random phase in every run"),
    ],
)
def test_a_verdict_says_what_is_known_and_what_is_not(effects, significant, rest, verdict, why):
    said = _verdict(effects, significant, rest, None)
    assert said[0] is verdict
    assert why in said[1]


@pytest.mark.parametrize(
    ("effects", "rest", "floors", "verdict"),
    [
        ((), [], 1.1, Verdict.ADEQUATE),
        ((NamedEffect("steering_lag", {}, (), {}),), [], 4.0, Verdict.NAMED),
        ((NamedEffect("steering_lag", {}, ("mocap_latency",), {}),), [], 4.0, Verdict.AMBIGUOUS),
        ((NamedEffect("steering_lag", {}, (), {}),), [], 5.1, Verdict.UNKNOWN),
        ((), [PATCH], 2.0, Verdict.UNKNOWN),
    ],
)
def test_free_driving_is_unknown_far_above_its_floor_or_where_something_is_depended_on(effects, rest, floors, verdict):
    held = HeldOut(9, {"heading_rms_deg": {"before": 9.0, "after": floors, "floor": 1.0}}, ())
    assert verdict_of_windows(effects, rest, _above(held, RESIDUAL.far_above_noise))[0] is verdict
    assert _above(held, RESIDUAL.within_repeatability) is (floors > 1.25)


def test_what_got_worse_by_more_than_the_floor_is_told():
    runs = [SimpleNamespace(trajectory=name, run_id=f"{name or 'free'}-{k}") for name in ("1", "2", "") for k in (1, 2)]
    before = off_by(*[3e-3] * 6)
    # Squares: 9 before; 9 + 4 × 0.25, 9 + 4 × 4 and less, the floor's square being 4 mm².
    after = off_by(*[np.sqrt(10.0) * 1e-3] * 2, *[5e-3] * 2, *[1e-3] * 2)
    kept = Kept(np.repeat([0, 1, 2], 2), runs)
    found = _held_out(kept, Assessment(before, after, FLOOR, FLOOR, None))
    assert found.worse_on == ("2",)
    assert found.runs == 6
    assert found.errors["position_rms_mm"]["before"] == pytest.approx(3.0)
    turned = _held_out(kept, Assessment(after, before, FLOOR, FLOOR, None))
    assert turned.worse_on == ("free-1",)
