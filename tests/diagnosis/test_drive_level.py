"""The level of the drive: found where sessions differ in it, and in nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from differential_vehicle import COARSE, HEADER, Campaign, Differential

from agvbench.diagnosis import Verdict, diagnose
from agvbench.diagnosis.data.readings import Readings, read_windows
from agvbench.diagnosis.data.windows import Horizon
from agvbench.diagnosis.estimation.fit import fit
from agvbench.diagnosis.free_driving.drive_level import drive_levels, nodal_deviation
from agvbench.diagnosis.free_driving.maps import smooth_maps, start_values_of_windows
from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.model.predictor import Predictor


def fitted(readings: Readings) -> tuple[Predictor, np.ndarray]:
    maps = smooth_maps(readings.runs, HEADER.neutral, 9, 6, is_differential=True)
    start = start_values_of_windows(maps, readings, HEADER.geometry)
    found = fit(Predictor(Batch(readings, maps, HEADER.geometry)), start, np.empty((0, 2)))
    return found.predictor, found.parameters


def sessions_of(truth: Differential, seed: int, **changes: float) -> tuple[Readings, Predictor, np.ndarray]:
    runs = list(Campaign(truth, seed=seed, sessions=3, **changes))
    readings = read_windows(runs, Horizon(), HEADER.neutral, turns_on_the_spot=True)
    return readings, *fitted(readings)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("hidden", [{}, {"speed_lag_s": 0.4}, {"delay_s": 0.2}, {"yaw_lag_s": 0.5}])
def test_sessions_of_one_level_do_not_differ(hidden, seed):
    levels = drive_levels(*sessions_of(Differential(**hidden), seed))
    assert len(levels) == 3
    assert not any(level.significant for level in levels.values())


@pytest.mark.parametrize("gain", [0.7, 1.15])
def test_a_session_of_another_level_differs(gain):
    readings, predictor, parameters = sessions_of(Differential(), 0, speed_gain=gain)
    levels = drive_levels(readings, predictor, parameters)
    assert [name for name, level in levels.items() if level.significant] == ["day 2"]
    other = levels["day 2"]
    assert other.significant
    assert other.factor == pytest.approx(gain / 0.9, abs=4.0 * other.stderr + 0.02)
    assert 0.05 <= nodal_deviation(predictor, parameters) < 0.4


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("factor", [1.0, 0.8])
def test_the_distances_of_held_commands_tell_the_level_where_single_speeds_are_noise(factor, seed):
    levels = drive_levels(*sessions_of(COARSE, seed, speed_gain=factor * COARSE.speed_gain))
    assert [name for name, level in levels.items() if level.significant] == ([] if factor == 1.0 else ["day 2"])
    assert levels["day 2"].factor == pytest.approx(factor, abs=0.07)


def test_another_level_on_the_test_day_is_followed():
    runs = list(Campaign(Differential(speed_lag_s=0.2), sessions=4, speed_gain=0.6))
    campaign = Campaign(Differential(), sessions=1, seconds=1.0)
    campaign.runs = [
        run.__class__(**{**vars(run), "split": "held_out" if k == 3 else "fit"}) for k, run in enumerate(runs)
    ]
    found = diagnose(campaign)
    assert [effect.name for effect in found.effects] == ["speed_lag"]
    assert found.verdict in (Verdict.NAMED, Verdict.UNKNOWN)
    errors = found.held_out.errors["position_rms_mm"]
    assert errors["after"] < 0.8 * errors["before"]


def test_an_effect_at_its_bound_is_not_named():
    # A wheel that is a quarter larger turns the vehicle by more than the library's bound of 1 1/m allows.
    found = diagnose(Campaign(Differential(right_wheel=1.6)))
    assert "wheel_diameter_mismatch" not in [effect.name for effect in found.effects]
    assert found.verdict is Verdict.UNKNOWN
