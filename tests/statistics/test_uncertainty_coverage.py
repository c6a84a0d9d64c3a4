"""Intervals of budgets contain the true mean in 95 % of simulated campaigns, with one dominant source at a time."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy import special, stats

from agvbench.campaign.uncertainty_statement import Evaluation
from agvbench.statistics.rest_poses import RestPose
from agvbench.statistics.uncertainty.end_pose_budgets import SOURCES, budgets_of
from agvbench.statistics.uncertainty.repeats import RestPoses
from agvbench.types import Pose

pytestmark = pytest.mark.slow
CAMPAIGNS = 2000
FRAMES = 15
TARGET = np.array([1.0, 1.0, math.pi / 2])
SPEED_MPS, TURN_RATE_RADPS = 0.015, 0.02


@dataclass(frozen=True)
class Case:
    """Campaigns: bias (m, m, rad) of the end pose, its scatter, standard deviations of sources by key, noise."""

    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scatter_m: float = 0.003
    scatter_rad: float = 0.005
    sources: dict[str, float] = field(default_factory=dict)
    repeats: int = 5
    noise_m: float = 1e-4
    noise_rad: float = 1e-4
    nulled: bool = False
    rectangular: bool = False
    sessions: int = 1
    session_m: float = 0.0


def compose(a, b):
    """Return poses `b`, given in the frames `a`, in the frame `a` is given in; arrays (…, 3)."""
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    x = a[..., 0] + c * b[..., 0] - s * b[..., 1]
    return np.stack([x, a[..., 1] + s * b[..., 0] + c * b[..., 1], a[..., 2] + b[..., 2]], axis=-1)


def inverse(a):
    """Return the inverse of poses (…, 3)."""
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack([-c * a[..., 0] - s * a[..., 1], s * a[..., 0] - c * a[..., 1], -a[..., 2]], axis=-1)


class Camera:
    """Errors of the camera, the same in all runs of a campaign: arrays of shape (CAMPAIGNS, 1, …)."""

    def __init__(self, case, rng):
        def drawn(key, *axes):
            size = case.sources.get(key, 0.0)
            shape = (CAMPAIGNS, 1, *axes)
            if case.rectangular:
                return rng.uniform(-math.sqrt(3.0) * size, math.sqrt(3.0) * size, shape)
            return size * rng.normal(size=shape)

        self.place = [1e-3 * drawn("camera_position_mm", 2) for _ in range(2)]
        self.turn = [np.radians(drawn("camera_heading_deg")) for _ in range(2)]
        self.scale = 1.0 + 1e-6 * drawn("camera_scale_ppm")
        alignment = np.radians(drawn("heading_alignment_deg"))[..., np.newaxis]
        self.marker = np.concatenate([1e-3 * drawn("marker_offset_mm", 2), alignment], axis=-1)
        self.late_s = 1e-3 * drawn("clock_ms")

    def sees(self, start, end):
        """Return start and end as measured, without noise."""
        seen = [
            self._seen(np.broadcast_to(pose, end.shape), place, turn)
            for pose, place, turn in zip((start, end), self.place, self.turn, strict=True)
        ]
        seen[1][..., 0] += SPEED_MPS * self.late_s  # the vehicle still creeps and turns at the end
        seen[1][..., 2] += TURN_RATE_RADPS * self.late_s
        return seen

    def _seen(self, pose, place, turn):
        seen = compose(pose, self.marker)
        return np.stack([*(self.scale * seen[..., k] + place[..., k] for k in range(2)), seen[..., 2] + turn], axis=-1)


def campaigns(case, rng):
    """Return measured starts and ends (CAMPAIGNS, n, 3), sessions (n,), and the true bias (CAMPAIGNS, 3)."""
    camera, start = Camera(case, rng), np.zeros(3)
    goal = TARGET + np.array(case.bias)
    true = np.broadcast_to(goal, (CAMPAIGNS, 1, 3))
    for _ in range(4 * case.nulled):  # plans are corrected until this camera sees the target reached
        seen_start, seen_end = camera.sees(start, true)
        true = true - (compose(inverse(seen_start), seen_end) - goal)
    spread = np.array([case.scatter_m, case.scatter_m, case.scatter_rad])
    ends = true + spread * rng.normal(size=(CAMPAIGNS, case.repeats, 3))
    session = np.arange(case.repeats) % case.sessions
    ends[..., :2] += case.session_m * rng.normal(size=(CAMPAIGNS, case.sessions, 2))[:, session]
    noise = np.array([case.noise_m, case.noise_m, case.noise_rad]) / math.sqrt(FRAMES)
    measured = [pose + noise * rng.normal(size=pose.shape) for pose in camera.sees(start, ends)]
    return *measured, session, true[:, 0] - TARGET


def mean_distance_mm(bias, scatter_m):
    """Return the mean distance of a normal cloud from the target (Rice's distribution); bias (…, 2)."""
    z = np.sum(bias**2, axis=-1) / (4.0 * scatter_m**2)
    bessel = (1.0 + 2.0 * z) * special.i0e(z) + 2.0 * z * special.i1e(z)
    return 1e3 * scatter_m * math.sqrt(math.pi / 2.0) * bessel


def hits(case, seed=0):
    """Return in how many campaigns the intervals of position and heading contain the true means."""
    starts, ends, session, bias = campaigns(case, np.random.default_rng(seed))
    errors = np.array([case.noise_m, case.noise_m, case.noise_rad]) / math.sqrt(FRAMES)
    moves = (SPEED_MPS / math.sqrt(2.0), TURN_RATE_RADPS / math.sqrt(2.0)) if "clock_ms" in case.sources else (0.0, 0.0)
    kind = "rectangular" if case.rectangular else "normal"
    stated = {key: Evaluation(size, kind) for key, size in case.sources.items()}
    truths = mean_distance_mm(bias[:, :2], math.hypot(case.scatter_m, case.session_m)), np.degrees(bias[:, 2])
    found = np.zeros(2, dtype=int)
    for start, end, *true in zip(starts, ends, *truths, strict=True):
        runs = []
        for *pair, name in zip(start.tolist(), end.tolist(), session.tolist(), strict=True):
            rests = (RestPose(Pose(*at), *errors, FRAMES, 0, *moves) for at in pair)
            runs.append(RestPoses(("5", "calibrated"), Pose(*TARGET), *rests, session=str(name)))
        for which, one in enumerate(budgets_of(runs, stated)):
            low, high = one.interval
            found[which] += low <= true[which] <= high
    return found


SIZES = {
    "camera_position_mm": 6.0, "camera_scale_ppm": 6000.0, "camera_heading_deg": 0.4, "marker_offset_mm": 6.0,
    "heading_alignment_deg": 0.4, "clock_ms": 400.0,
}  # fmt: skip
AWAY = {"camera_scale_ppm": (0.05, 0.04, 0.02), "clock_ms": (-0.06, 0.0, 0.02)}
NOISY = {"scatter_m": 3e-4, "noise_rad": 1e-3, "noise_m": 2e-4}


def pvalue(found, share, alternative):
    """Return the p-value of so many of `CAMPAIGNS` hits if intervals cover with probability `share`."""
    return stats.binomtest(int(found), CAMPAIGNS, share, alternative=alternative).pvalue


@pytest.mark.parametrize("key", SOURCES)
def test_intervals_cover_95_percent_where_one_source_dominates_and_the_mean_is_far_from_the_target(key):
    case = Case(AWAY.get(key, (-0.05, 0.04, 0.02)), sources={key: SIZES[key]})
    position, heading = hits(case)
    assert pvalue(position, 0.95, "two-sided") > 1e-3, position / CAMPAIGNS
    # At rest the speed and the turn rate are bounds, which include what both ends do.
    assert pvalue(heading, 0.95, "less" if key == "clock_ms" else "two-sided") > 1e-3, heading / CAMPAIGNS


@pytest.mark.parametrize(
    "case",
    [
        Case((0.03, -0.02, 0.02), repeats=3),
        Case((0.01, 0.0, 0.02), repeats=10, **NOISY),  # noise as large as the scatter, which contains it
        Case((0.03, -0.02, 0.02), repeats=15, scatter_m=0.001, sessions=3, session_m=0.004),
    ],
    ids=["three repeats", "noisy camera", "sessions that differ"],
)
def test_intervals_of_repeats_cover_95_percent(case):
    position, _ = hits(case)
    assert pvalue(position, 0.95, "two-sided") > 1e-3, position / CAMPAIGNS


@pytest.mark.parametrize(
    "case",
    [
        Case(sources={"heading_alignment_deg": 0.5 / math.sqrt(3.0)}, nulled=True, rectangular=True),
        Case(sources={"camera_position_mm": 3.0}, nulled=True),
        Case(sources={key: 0.5 * SIZES[key] for key in list(SIZES)[:5]}, nulled=True),
        Case((0.003, 0.0, 0.0), sources={"camera_scale_ppm": 3000.0}),
        Case(repeats=30, **NOISY),
    ],
    ids=["alignment within limits", "positions", "five sources", "bias of one scatter", "noise about the target"],
)
def test_intervals_cover_at_least_95_percent_where_plans_were_corrected_to_the_target(case):
    position, _ = hits(case)
    assert pvalue(position, 0.95, "less") > 1e-3, position / CAMPAIGNS


def test_few_distances_about_the_target_are_skewed_and_their_intervals_cover_92_percent():
    position, _ = hits(Case(repeats=5))
    assert pvalue(position, 0.92, "less") > 1e-3, position / CAMPAIGNS
