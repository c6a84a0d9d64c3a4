"""What is learned of a first session: biases that stand out, and no scatter."""

import numpy as np
import pytest

from agvbench.workflows.loop_remainders import shrunk


def errors_left(bias_sds, n=10, draws=4000):
    """Root mean square of what is left of a bias after learning it from n repeats of standard deviation 1."""
    rng = np.random.default_rng(3)
    learned = [shrunk(bias_sds + rng.standard_normal((n, 1)))[0] for _ in range(draws)]
    return float(np.sqrt(np.mean((bias_sds - np.array(learned)) ** 2)))


@pytest.mark.parametrize("bias_sds", [0.0, 0.3, 1.0, 5.0, -20.0])
def test_what_is_left_is_hardly_more_than_the_standard_error(bias_sds):
    assert errors_left(bias_sds) < 1.25 / np.sqrt(10)


def test_where_there_is_no_bias_less_is_learned_than_the_mean_says():
    assert errors_left(0.0) < 0.75 / np.sqrt(10)


def test_a_large_bias_is_learned_whole():
    values = 40.0 + np.random.default_rng(1).standard_normal((10, 3))
    np.testing.assert_allclose(shrunk(values), values.mean(axis=0), rtol=1e-3)
