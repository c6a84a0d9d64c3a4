"""Standard errors against the scatter of estimates that they foretell."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from whole_information import every_parameter

from agvbench.diagnosis.estimation.standard_errors import standard_errors

GROUPS, REPEATS = 30, 5
GROUP = np.repeat(np.arange(GROUPS), REPEATS)


def fitted(slopes, missed):
    """Return the fit of a line through nothing, whose likelihood takes every run for a draw of its own."""
    value = float(slopes @ missed / (slopes @ slopes))
    return SimpleNamespace(
        predictor=SimpleNamespace(
            maps=SimpleNamespace(size=0), parameter_names=["slope"], readings=SimpleNamespace(initial_states=None)
        ),
        gradient=(slopes * (missed - slopes * value))[:, None],
        information=every_parameter((slopes**2)[:, None, None]),
        total_information=np.array([[float(slopes @ slopes)]]),
        covariance=np.array([[1.0 / float(slopes @ slopes)]]),
        covariance_by_priors=np.zeros((1, 1)),
    ), value


def drawn(rng, shared, own):
    slopes = np.repeat(rng.uniform(0.5, 2.0, GROUPS), REPEATS)
    missed = np.repeat(rng.normal(0.0, shared, GROUPS), REPEATS) + rng.normal(0.0, own, GROUPS * REPEATS)
    return fitted(slopes, missed)


@pytest.mark.parametrize(("shared", "own"), [(0.0, 1.0), (1.0, 1.0), (0.0, 0.3), (3.0, 0.1)])
def test_as_large_as_estimates_scatter_whatever_the_likelihood_believes(shared, own):
    rng = np.random.default_rng(7)
    draws = [drawn(rng, shared, own) for _ in range(600)]
    told = [float(standard_errors(fit, GROUP)[0]) for fit, _ in draws]
    variance_components = float(np.std([value for _, value in draws]))
    assert 0.95 < float(np.sqrt(np.mean(np.square(told)))) / variance_components < 1.3
    covered = np.mean([abs(value) < 1.96 * error for error, (_, value) in zip(told, draws, strict=True)])
    assert 0.92 < covered < 0.975


def test_few_groups_that_agree_by_chance_are_not_believed():
    rng = np.random.default_rng(3)
    slopes, missed = np.ones(len(GROUP)), rng.standard_normal(len(GROUP))
    missed -= np.repeat(missed.reshape(GROUPS, REPEATS).mean(axis=1), REPEATS)  # groups agree, runs do not
    missed += np.repeat(rng.normal(0.0, 1e-3, GROUPS), REPEATS)
    fit, _ = fitted(slopes, missed)
    assert standard_errors(fit, GROUP)[0] > 0.8 / np.sqrt(len(GROUP))


def test_what_one_group_alone_tells_is_not_said_to_be_known_better_than_the_likelihood_does():
    rng = np.random.default_rng(1)
    slopes = np.where(GROUP == 0, 1.0, 1e-6)
    fit, _ = fitted(slopes, 0.01 * rng.standard_normal(len(GROUP)))
    assert standard_errors(fit, GROUP)[0] == pytest.approx(np.sqrt(1.0 / REPEATS), rel=1e-3)
