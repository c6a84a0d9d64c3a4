"""What a step is held against."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from agvbench.diagnosis.estimation.likelihood import objective, residual_of
from agvbench.diagnosis.estimation.variance import initial_variance_components
from agvbench.diagnosis.model.predictor import RANDOM_EFFECTS

RUNS, SAMPLES = 3, 5


class Readings(SimpleNamespace):
    """Runs that stood at the origin."""

    seen = np.ones((RUNS, SAMPLES), dtype=bool)
    initial_states = None
    poses = np.zeros((RUNS, SAMPLES, 3))
    start_stderr = np.full((RUNS, 3), 1e-3)

    def __len__(self):
        return RUNS


def squares(poses):
    batch = SimpleNamespace(autocorrelation_time=1.0, has_heavy_tails=False)
    context = SimpleNamespace(readings=Readings(), batch=batch, random_effects=RANDOM_EFFECTS)
    return objective(context, residual_of(context, poses), np.zeros((RUNS, 6)), initial_variance_components())


def test_the_farther_off_the_larger():
    poses = np.zeros((RUNS, SAMPLES, 3))
    assert squares(poses) == 0.0
    assert 0.0 < squares(poses + 0.01) < squares(poses + 0.02)


@pytest.mark.parametrize("beyond", [np.inf, -np.inf, np.nan])
def test_what_a_step_too_far_predicts_is_infinitely_bad_and_no_warning(beyond):
    poses = np.zeros((RUNS, SAMPLES, 3))
    poses[1, 2:] = beyond
    assert squares(poses) == np.inf
