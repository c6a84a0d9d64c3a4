"""The motion filter: what it states of pose and speed is what it errs by, at any rate and for any vehicle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from agvbench.diagnosis.data.motion_filter import MotionFilter

NOISE = (2e-3, 4e-3)


def jerked(t_s: np.ndarray, jerk: float, rng: np.random.Generator) -> np.ndarray:
    """Return position and velocity (n, 2) driven by white-noise jerk, by Van Loan's discretisation of the process."""
    state, out = np.zeros(3), np.zeros((len(t_s), 2))
    drift = np.diag([1.0, 1.0], 1)
    density = np.diag([0.0, 0.0, jerk**2])
    blocks = expm(
        np.block([[-drift, density], [np.zeros((3, 3)), drift.T]]) * np.diff(t_s, prepend=t_s[0])[:, None, None]
    )
    for k, (step, block) in enumerate(zip(np.diff(t_s, prepend=t_s[0]), blocks, strict=True)):
        transition = block[3:, 3:].T
        covariance = transition @ block[:3, 3:]
        root = np.linalg.cholesky(covariance + 1e-18 * np.eye(3)) if step else np.zeros((3, 3))
        state = transition @ state + root @ rng.normal(size=3)
        out[k] = state[:2]
    return out


def recording(rate: float, jerk: float, seed: int, count: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return irregular times, noisy poses (n, 3) and true pose and velocity (n, 2, 3)."""
    rng = np.random.default_rng(seed)
    steps = rng.uniform(0.5, 1.5, count) / rate
    steps[rng.random(count) < 0.01] *= 5.0  # gaps
    t_s = np.cumsum(steps)
    truth = np.stack([jerked(t_s, jerk, rng) for _ in range(3)], axis=-1)
    noise = rng.normal(size=(count, 3)) * np.array([NOISE[0], NOISE[0], NOISE[1]])
    return t_s, truth[:, 0] + noise, truth


@pytest.mark.parametrize(("rate", "jerk"), [(5.0, 0.02), (20.0, 0.5), (100.0, 2.0), (1000.0, 20.0)])
@pytest.mark.slow
def test_the_errors_stated_are_those_made(rate, jerk):
    squares = []
    for seed in range(4):
        t_s, motion, truth = recording(rate, jerk, seed)
        states = MotionFilter.fitted([(t_s, motion)]).states(t_s, motion)
        pose = (states.pose - truth[:, 0]) / states.pose_stderr
        velocity = (states.velocity - truth[:, 1]) / states.velocity_stderr
        squares.append([np.mean(pose[50:] ** 2, axis=0), np.mean(velocity[50:] ** 2, axis=0)])
    np.testing.assert_allclose(np.mean(squares, axis=0), np.ones((2, 3)), atol=0.3)


@pytest.mark.slow
def test_noise_and_jerk_are_found():
    t_s, motion, _ = recording(100.0, 2.0, 0, 4000)
    fitted = MotionFilter.fitted([(t_s, motion)])
    assert fitted.noise == pytest.approx(NOISE, rel=0.1)
    assert fitted.jerk == pytest.approx((2.0, 2.0), rel=0.25)


def test_later_frames_change_nothing():
    t_s, motion, _ = recording(50.0, 1.0, 1)
    fitted = MotionFilter.fitted([(t_s, motion)])
    whole, part = fitted.states(t_s, motion), fitted.states(t_s[:300], motion[:300])
    for name in ("pose", "velocity", "pose_stderr", "velocity_stderr"):
        np.testing.assert_array_equal(getattr(whole, name)[:300], getattr(part, name))


SHORT = recording(50.0, 1.0, 2, 200)


@given(scale=st.floats(0.01, 100.0), shift=st.floats(-1e3, 1e3))
def test_units_and_origin_do_not_matter(scale, shift):
    t_s, motion, _ = SHORT
    fitted = MotionFilter(np.array(NOISE), np.array([1.0, 1.0]))
    scaled = MotionFilter(scale * fitted.noise, scale * fitted.jerk)
    plain, moved = fitted.states(t_s, motion), scaled.states(t_s + 7.0, scale * motion + shift)
    np.testing.assert_allclose((moved.pose - shift) / scale, plain.pose, atol=1e-6 * (1.0 + abs(shift) / scale))
    np.testing.assert_allclose(moved.velocity_stderr[5:] / scale, plain.velocity_stderr[5:], rtol=1e-6)


def test_a_gap_makes_the_speed_uncertain():
    t_s, motion, _ = recording(100.0, 2.0, 3)
    kept = (t_s < t_s[300]) | (t_s > t_s[300] + 0.5)
    states = MotionFilter(np.array(NOISE), np.array([2.0, 2.0])).states(t_s[kept], motion[kept])
    at = int(np.argmax(np.diff(t_s[kept]))) + 1
    assert states.velocity_stderr[at, 0] > 3.0 * states.velocity_stderr[at - 1, 0]
    assert states.velocity_stderr[at + 30, 0] < 1.2 * states.velocity_stderr[at - 1, 0]


def test_the_speed_is_that_along_the_heading():
    t_s = np.arange(0.0, 5.0, 0.02)
    motion = np.column_stack([-0.6 * t_s * math.sin(2.0), 0.6 * t_s * math.cos(2.0), np.full(len(t_s), 2.0)])
    states = MotionFilter(np.array([1e-3, 1e-3]), np.array([0.5, 0.5])).states(t_s, motion)
    np.testing.assert_allclose(states.longitudinal_speed()[10:], 0.0, atol=1e-6)
