"""The camera: its noise is that of a rigid body fitted to markers, its faults come as often as declared."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agvbench.simulator import Camera
from agvbench.simulator.camera import FIVE_MARKERS
from agvbench.types import Frames

N = 40_000
T = np.arange(N) / 120.0
POSES = np.column_stack((0.3 * T, np.sin(T), 0.7 * T))


def clean(**changes):
    nothing = dict.fromkeys(("lost", "untracked", "doubled", "late", "wrong"), 0.0)
    return Camera(**(nothing | changes))


def observe(camera, seed=0, t=T, poses=POSES):
    return camera.observe(t, poses, np.random.default_rng(seed))


def wrapped(angle):
    return np.angle(np.exp(1j * angle))


def kabsch(markers, seen):
    """Return the rigid motion that best carries markers to seen ones, by singular values: an independent fit."""
    u, _, vt = np.linalg.svd((markers - markers.mean(0)).T @ (seen - seen.mean(0)))
    rotation = vt.T @ np.diag([1.0, np.linalg.det(vt.T @ u.T)]) @ u.T
    residual = (seen - seen.mean(0)) - (markers - markers.mean(0)) @ rotation.T
    return seen.mean(0), math.atan2(rotation[1, 0], rotation[0, 0]), math.sqrt((residual**2).sum(1).mean())


def test_a_perfect_camera_sees_the_truth():
    frames = observe(Camera.perfect())
    assert np.array_equal(frames.x_m, POSES[:, 0])
    assert np.array_equal(frames.y_m, POSES[:, 1])
    assert np.abs(wrapped(frames.heading_rad - POSES[:, 2])).max() < 1e-12
    assert frames.heading_rad.min() > -math.pi
    assert frames.heading_rad.max() <= math.pi
    assert frames.mean_error_m.max() < 1e-8
    assert np.array_equal(frames.received_s, frames.t_s)
    assert np.array_equal(frames.frame, np.arange(N))


@pytest.mark.parametrize("noise", [0.0001, 0.002, (0.0001, 0.0005, 0.001, 0.0015, 0.002)])
def test_noise_is_that_of_the_markers_centroid_and_spread(noise):
    camera = clean(marker_noise_m=noise)
    frames = observe(camera)
    sigma = np.broadcast_to(noise, 5)
    places = np.array(FIVE_MARKERS) - np.mean(FIVE_MARKERS, axis=0)
    radii = np.hypot(*places.T)
    position = np.sqrt(np.sum(sigma**2)) / 5
    heading = np.sqrt(np.sum(sigma**2 * radii**2)) / np.sum(radii**2)
    assert (camera.position_noise_m, camera.heading_noise_rad) == pytest.approx((position, heading))
    assert np.std(frames.x_m - POSES[:, 0]) == pytest.approx(position, rel=0.02)
    assert np.std(frames.y_m - POSES[:, 1]) == pytest.approx(position, rel=0.02)
    assert np.std(wrapped(frames.heading_rad - POSES[:, 2])) == pytest.approx(heading, rel=0.02)


def test_the_fit_is_the_best_rigid_motion():
    """Rebuild the markers that were seen from the same random numbers, and fit them by singular values."""
    camera, poses = clean(marker_noise_m=0.01), POSES[:50]
    tracker = camera.tracker(np.random.default_rng(5))
    seed = np.random.default_rng(5).integers(2**63, size=2)[0]
    noise = 0.01 * np.random.default_rng(int(seed)).standard_normal((50, 5, 2))
    frames = tracker.observe(T[:50], poses)
    markers = np.array(FIVE_MARKERS) - np.mean(FIVE_MARKERS, axis=0)
    for i, (x, y, heading) in enumerate(poses):
        c, s = math.cos(heading), math.sin(heading)
        seen = (markers + noise[i]) @ np.array([[c, s], [-s, c]]) + (x, y)
        centre, turned, residual = kabsch(markers, seen)
        assert (frames.x_m[i], frames.y_m[i]) == pytest.approx(tuple(centre), abs=1e-12)
        assert wrapped(frames.heading_rad[i] - turned) == pytest.approx(0.0, abs=1e-12)
        assert frames.mean_error_m[i] == pytest.approx(residual, rel=1e-6)


def test_lost_frames_leave_gaps_in_the_numbers():
    frames = observe(clean(lost=0.05))
    assert 1.0 - len(frames) / N == pytest.approx(0.05, abs=0.005)
    assert np.all(np.diff(frames.frame) >= 1)
    assert np.array_equal(frames.t_s, T[frames.frame])


def test_doubled_frames_come_twice_within_a_frame():
    frames = observe(clean(doubled=0.05))
    numbers, counts = np.unique(frames.frame, return_counts=True)
    assert len(numbers) == N
    assert np.mean(counts == 2) == pytest.approx(0.05, abs=0.005)
    assert counts.max() == 2
    for number in numbers[counts == 2][:20]:
        twins = frames.select(frames.frame == number)
        assert twins.x_m[0] == twins.x_m[1]
        assert 0.0 <= twins.received_s[1] - twins.received_s[0] <= 1.0 / 120.0


def test_late_frames_arrive_out_of_order_with_their_capture_time():
    frames = observe(clean(late=0.05, late_s=0.03, latency_s=0.005))
    assert np.all(np.diff(frames.received_s) >= 0.0)
    assert np.any(np.diff(frames.t_s) < 0.0)
    delay = frames.received_s - frames.t_s
    late = delay > 0.005 + 1e-12
    assert np.mean(late) == pytest.approx(0.05, abs=0.005)
    assert np.mean(delay[late] - 0.005) == pytest.approx(0.03, rel=0.06)
    assert np.array_equal(frames.t_s, T[frames.frame])


def test_untracked_frames_come_in_bursts_of_nothing():
    frames = observe(clean(untracked=0.004, burst_frames=6.0))
    gone = ~frames.tracked
    for values in (frames.x_m, frames.y_m, frames.heading_rad, frames.mean_error_m):
        assert np.array_equal(np.isnan(values), gone)
    begins = np.count_nonzero(gone[1:] & ~gone[:-1])
    assert np.count_nonzero(gone) / begins == pytest.approx(6.0, rel=0.15)
    assert begins / N == pytest.approx(0.004, rel=0.2)


def test_wrong_frames_jump_by_metres_and_look_tracked():
    frames = observe(clean(wrong=0.01, wrong_m=1.5))
    jump = np.hypot(frames.x_m - POSES[:, 0], frames.y_m - POSES[:, 1])
    wrong = jump > 0.01
    assert frames.tracked.all()
    assert np.mean(wrong) == pytest.approx(0.01, rel=0.2)
    assert np.mean(jump[wrong]) == pytest.approx(1.5, rel=0.1)


def same(a: Frames, b: Frames) -> bool:
    order_a, order_b = (np.lexsort((f.received_s, f.frame)) for f in (a, b))
    return all(
        np.array_equal(getattr(a, name)[order_a], getattr(b, name)[order_b], equal_nan=name != "tracked")
        for name in ("t_s", "x_m", "y_m", "heading_rad", "tracked", "frame", "mean_error_m", "received_s")
    )


@given(st.lists(st.integers(0, 200), max_size=8), st.integers(0, 2**32))
@settings(max_examples=40, deadline=None)
def test_a_run_cut_into_batches_is_the_same_run(cuts, seed):
    camera = Camera(lost=0.05, untracked=0.03, doubled=0.05, late=0.1, wrong=0.02)
    t, poses = T[:200], POSES[:200]
    whole = camera.observe(t, poses, np.random.default_rng(seed), first_frame=10)
    tracker = camera.tracker(np.random.default_rng(seed), first_frame=10)
    edges = [0, *sorted(cuts), 200]
    batches = [tracker.observe(t[a:b], poses[a:b]) for a, b in itertools.pairwise(edges)]
    assert same(Frames.concatenate(batches), whole)


def test_all_randomness_comes_from_the_generator_passed_in():
    camera = Camera(lost=0.05, untracked=0.03, doubled=0.05, late=0.1, wrong=0.02)
    np.random.seed(0)  # noqa: NPY002 - global state must not matter
    first = observe(camera, seed=9)
    np.random.seed(1)  # noqa: NPY002
    assert same(first, observe(camera, seed=9))
    assert not same(first, observe(camera, seed=10))
    rng = np.random.default_rng(9)
    assert same(first, camera.observe(T, POSES, rng))
    assert not same(first, camera.observe(T, POSES, rng))


def test_a_stationary_vehicle_is_passed_over_without_copying_its_truth():
    poses = np.zeros((10, 3))
    observe(Camera(), t=T[:10], poses=poses)
    assert not poses.any()


def test_no_frames_are_no_frames():
    assert len(observe(Camera(), t=np.empty(0), poses=np.empty((0, 3)))) == 0


@given(
    st.floats(-5.0, 5.0), st.lists(st.floats(0.0, 0.3), min_size=1, max_size=10), st.sampled_from([50.0, 120.0, 240.0])
)
@settings(max_examples=60, deadline=None)
def test_frame_times_tile_the_time_line(start, lengths, rate):
    camera, edges = Camera(rate_hz=rate), start + np.concatenate(([0.0], np.cumsum(lengths)))
    pieces = [camera.frame_times(a, b) for a, b in itertools.pairwise(edges)]
    times = np.concatenate(pieces)
    assert np.array_equal(times, camera.frame_times(edges[0], edges[-1]))
    assert np.allclose(times * rate, np.round(times * rate), atol=1e-9)


def test_options_set_by_name():
    assert Camera.from_options({"lost": "0.01", "rate_hz": 240}) == Camera(lost=0.01, rate_hz=240.0)
