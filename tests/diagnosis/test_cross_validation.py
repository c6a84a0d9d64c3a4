"""Cross-validation over groups of runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from agvbench.diagnosis.estimation.cross_validation import eigenvectors

WHITENED = Path(__file__).with_name("nearly_identity.npz")
"""Of a campaign with nothing hidden: what four folds say, where all five say the identity. NumPy's solver gave up."""


def test_eigenvectors_are_found_where_nearly_all_eigenvalues_are_one():
    matrix = np.load(WHITENED)["matrix"]
    values, vectors = eigenvectors(matrix)
    assert np.count_nonzero(np.abs(values - 1.0) < 1e-9) > 40
    np.testing.assert_allclose(vectors * values @ vectors.T, matrix, atol=1e-11)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(len(matrix)), atol=1e-12)
