from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest

from agvbench.diagnosis.residuals.repeatability import repeatability, reproducibility
from agvbench.diagnosis.residuals.residuals import EndCovariance, PoseResiduals, lack_of_fit

GROUP = np.repeat(np.arange(40), 4)
STARTED_H = np.tile(np.linspace(0.0, 1.2, 4), 40)


def scattered(seed: int, *, scatter_m: float, common_m: float) -> PoseResiduals:
    """Return misses along x of runs in groups of four: `common_m` for a group, `scatter_m` for each run."""
    rng = np.random.default_rng(seed)
    off = rng.normal(0.0, common_m, 40)[GROUP] + rng.normal(0.0, scatter_m, 160)
    path = np.zeros((160, 24, 3))
    path[..., 0] = off[:, None]
    path[..., 1:] = rng.normal(0.0, 1e-5, (160, 1, 2))
    return PoseResiduals(path, np.ones((160, 24), dtype=bool), off, path[:, -1, 2])


def test_the_floor_is_the_scatter_of_repeats_whatever_they_have_in_common():
    for common, of in product((0.0, 0.05), (repeatability, reproducibility)):
        residuals = scattered(1, scatter_m=0.004, common_m=common)
        found = of(residuals, GROUP, STARTED_H) if of is repeatability else of(residuals, GROUP)
        assert found["position_rms_mm"] == pytest.approx(4.0, rel=0.15)
        assert found["delta_s_mm"] == pytest.approx(4.0, rel=0.15)
        assert found["along_mm"] == pytest.approx(4.0, rel=0.15)
        assert found["end_position_mm"] == pytest.approx(4.0, rel=0.15)
        assert found["end_position_median_mm"] == pytest.approx(4.0 * 0.6745, rel=0.2)
        assert found["across_mm"] < 0.1


def test_what_is_missed_across_shows_in_the_end_position_and_not_in_the_distance():
    missed = scattered(5, scatter_m=1e-6, common_m=0.0)
    missed.path[:, -1, 1] = 0.06
    found = missed.rms()
    assert found["end_position_mm"] == pytest.approx(60.0, rel=1e-3)
    assert found["across_mm"] == pytest.approx(60.0, rel=1e-3)
    assert missed.median_mm() == pytest.approx(60.0, rel=1e-3)
    assert found["delta_s_mm"] < 0.01
    assert found["along_mm"] < 0.01


def test_one_spoilt_run_hardly_lifts_the_floor():
    missed = scattered(2, scatter_m=0.004, common_m=0.0)
    missed.path[5, :, 0] += 1.0
    assert repeatability(missed, GROUP, STARTED_H)["position_rms_mm"] < 8.0
    assert reproducibility(missed, GROUP)["position_rms_mm"] < 8.0


def test_a_step_in_mid_campaign_enters_reproducibility_more_than_repeatability():
    missed = scattered(6, scatter_m=0.004, common_m=0.0)
    missed.path[STARTED_H > 0.6, :, 0] += 0.02
    # Of four repeats with a step d between the second and the third, the variance is d²/3, and that of the three
    # successive differences d²/6.
    assert repeatability(missed, GROUP, STARTED_H)["position_rms_mm"] == pytest.approx(np.hypot(4.0, 8.16), rel=0.1)
    assert reproducibility(missed, GROUP)["position_rms_mm"] == pytest.approx(np.hypot(4.0, 11.55), rel=0.1)


def test_runs_are_ordered_by_time_and_not_by_number():
    missed, rng = scattered(7, scatter_m=0.004, common_m=0.0), np.random.default_rng(0)
    missed.path[..., 0] += 0.02 * STARTED_H[:, None]
    order = rng.permutation(160)
    shuffled = PoseResiduals(
        missed.path[order], missed.seen[order], missed.delta_s_m[order], missed.delta_heading_rad[order]
    )
    found = repeatability(shuffled, GROUP[order], STARTED_H[order])
    assert found == pytest.approx(repeatability(missed, GROUP, STARTED_H))


def test_without_repeats_there_is_no_floor():
    missed = scattered(3, scatter_m=0.004, common_m=0.0)
    assert repeatability(missed, np.arange(160), STARTED_H) is None
    assert reproducibility(missed, np.arange(160)) is None
    assert lack_of_fit(missed, np.arange(160)) is None


@pytest.mark.slow
def test_scatter_alone_is_no_lack_of_fit():
    p_values = [lack_of_fit(scattered(seed, scatter_m=0.004, common_m=0.0), GROUP) for seed in range(200)]
    assert np.mean(np.array(p_values) < 0.05) < 0.11


def test_what_repeats_have_in_common_is_lack_of_fit():
    assert lack_of_fit(scattered(4, scatter_m=0.004, common_m=0.004), GROUP) < 1e-6


def test_what_other_runs_miss_is_no_lack_of_fit_of_those_tested():
    missed, tested = scattered(6, scatter_m=0.004, common_m=0.0), GROUP < 20
    alone = lack_of_fit(missed, GROUP, tested=tested)
    missed.path[~tested, :, 0] += 0.1 * GROUP[~tested, None]
    assert lack_of_fit(missed, GROUP, tested=tested) == pytest.approx(alone, rel=1e-6)
    assert lack_of_fit(missed, GROUP, tested=~tested) < 1e-12


def test_single_runs_are_tested_against_the_repeats_of_others():
    missed, tested = scattered(7, scatter_m=0.004, common_m=0.0), np.arange(160) < 8
    group = np.where(tested, 100 + np.arange(160), GROUP)
    assert lack_of_fit(missed, group, tested=tested) > 0.01
    missed.path[tested, :, 0] += 0.02
    assert lack_of_fit(missed, group, tested=tested) < 1e-6


def test_commands_that_share_a_value_of_the_maps_share_its_error():
    """Thirty commands in groups of ten turn with one of three values, each of which is off by what it may be."""
    group = np.repeat(np.arange(30), 2)
    slopes = np.zeros((60, 3, 3))
    slopes[np.arange(60), 2, group // 10] = 1.0
    spread = EndCovariance(np.broadcast_to(np.diag([1e-6, 1e-6, 4e-4]), (60, 3, 3)), slopes, np.eye(3) * 2e-4)
    p_values = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        ends = rng.multivariate_normal(np.zeros(3), spread.own[0], 60) + slopes @ rng.normal(0.0, math.sqrt(2e-4), 3)
        missed = PoseResiduals(ends[:, None, :], np.ones((60, 1), dtype=bool), ends[:, 0], ends[:, 2])
        p_values.append(lack_of_fit(missed, group, spread))
    assert np.mean(np.array(p_values) < 0.05) < 0.11
    assert np.mean(np.array(p_values) < 0.5) > 0.35
