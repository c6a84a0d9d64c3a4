"""Cross-validation by one Newton step, against least squares that really leave a fold out."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from whole_information import every_parameter

from agvbench.diagnosis.estimation.cross_validation import cross_validated
from agvbench.diagnosis.model.smoothness import PriorTerms

NO_BOUNDS = np.empty((0, 2))


def estimated(design, measured, prior):
    """Return the estimate from runs (R, K, P) whose prediction is linear, with the information of a prior about 0."""
    rows = design.reshape(-1, design.shape[-1])
    return np.linalg.lstsq(rows.T @ rows + prior, rows.T @ measured.ravel(), rcond=None)[0]


def linear_fit(design, measured, prior=None):
    """Return what `cross_validated` reads of a fit, of runs whose prediction is linear: design (R, K, P)."""
    prior = np.zeros((design.shape[-1],) * 2) if prior is None else prior
    best = estimated(design, measured, prior)
    miss = measured - design @ best
    return SimpleNamespace(
        predictor=SimpleNamespace(
            readings=SimpleNamespace(initial_states=None), maps=SimpleNamespace(size=design.shape[-1])
        ),
        parameters=best,
        loss=np.sum(miss**2, axis=1),
        information=every_parameter(np.einsum("rki,rkj->rij", design, design)),
        gradient=np.einsum("rki,rk->ri", design, miss),
        prior=PriorTerms(float(best @ prior @ best), prior, -prior @ best),
    )  # fmt: skip


@pytest.mark.parametrize("prior", [np.zeros((3, 3)), np.diag([0.0, 5.0, 0.0]), 3.0 * np.ones((3, 3))])
def test_a_linear_model_is_foretold_as_if_it_were_fitted_without_the_fold(prior):
    rng = np.random.default_rng(3)
    design, fold = rng.normal(size=(12, 5, 3)), np.repeat([0, 1, 2], 4)
    measured = design @ [1.0, -2.0, 0.5] + rng.normal(size=(12, 5))
    loss = cross_validated(linear_fit(design, measured, prior), fold, NO_BOUNDS)
    for k in range(3):
        left = estimated(design[fold != k], measured[fold != k], prior)
        expected = np.sum((measured - design @ left) ** 2, axis=1)
        assert loss[fold == k] == pytest.approx(expected[fold == k], rel=1e-4)


def test_what_only_one_fold_knows_is_fitted_to_it_though_every_run_depends_on_it():
    """A play shifts two levels that are only ever reached from one side; one group alone goes both ways."""
    rng = np.random.default_rng(4)
    # The others say next to nothing of it, but what they say is wrong by far.
    level, play = np.tile([[1.0, 0.0, -0.5], [0.0, 1.0, 0.5]], (6, 1)), np.tile([[1.0, 0.0, 0.5]], (2, 1))
    design = np.concatenate([level, play])[:, None, :] * np.ones((1, 4, 1))
    design[:12, :, 2] += 0.003 * rng.normal(size=(12, 4))
    measured = design @ [3.0, 2.0, 0.7] + 0.01 * rng.normal(size=(14, 4))
    fold = np.r_[np.repeat([1, 2], 6), 0, 0]
    loss = cross_validated(linear_fit(design, measured), fold, NO_BOUNDS)
    assert loss.max() < 4 * 0.03**2
