"""Budgets after the GUM: coverage in simulated campaigns, and formulas against independent ones."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from agvbench.campaign.uncertainty_statement import Evaluation, evaluations, read_statement
from agvbench.errors import FileError
from agvbench.statistics.intervals import failure_bound
from agvbench.statistics.pose_accuracy import completions, pose_accuracies, pose_accuracy, prediction_ellipse
from agvbench.statistics.run_errors import pose_errors
from agvbench.statistics.uncertainty.budget import Budget, Component, Role
from agvbench.statistics.uncertainty.end_pose_budgets import SOURCES, end_pose_budgets, key_to_state
from agvbench.statistics.uncertainty.tables import budget_table, component_table
from agvbench.types import Commands, Frames, Pose, Run

TARGET = Pose(1.0, 1.0, math.pi / 2)
COMMANDS = Commands(np.array([0.0, 1.0]), np.array([1700.0, 1500.0]), np.full(2, 1500.0), np.full(2, 1500.0))
NOWHERE = Pose(0.0, 0.0, 0.0)
TIMES = np.concatenate([np.arange(-12, 0), np.arange(31, 43)]) / 30.0
CAMPAIGNS = 2000


def seen(start, end, rng, *, noise_m=2e-4, noise_rad=1e-3, delay_s=0.01):
    """Return frames of a vehicle that rests at `start` before the first command and at `end` after the last."""
    moved = TIMES > 0.0
    x, y, heading = (np.where(moved, b, a) for a, b in zip(start, end, strict=True))
    n = len(TIMES)
    noise = rng.normal(size=(3, n)) * np.array([[noise_m], [noise_m], [noise_rad]])
    known = np.ones(n, dtype=bool)
    numbers = np.arange(n)
    return Frames(
        TIMES, x + noise[0], y + noise[1], heading + noise[2], known, numbers, np.full(n, 4e-4), TIMES + delay_s
    )


def run_to(end, rng, repeat=0, **camera):
    """Return a run whose true end pose in the start frame is `end`."""
    start = Pose(0.3 * rng.normal(), 0.3 * rng.normal(), 2.0 * rng.normal())
    frames = seen(start, start.compose(end), rng, **camera)
    row = {"run_id": f"r{repeat}", "experiment": "trajectory", "trajectory": "5", "condition": "calibrated"}
    return Run(
        **row, repeat=repeat, target=TARGET, started_s=10.0 * repeat, status="ok", firmware="", commands=COMMANDS,
        frames=frames,
    )  # fmt: skip


def scattered(rng, bias, spread, repeats):
    """Return end poses in the start frame with a bias and a scatter (m, m, rad)."""
    return [Pose(*(np.array(TARGET) + bias + spread * rng.normal(size=3))) for _ in range(repeats)]


def within_binomial_bounds(hits, *, share=0.95, alpha=1e-3):
    """Return whether so many of `CAMPAIGNS` hits are what chance `share` gives, two-sided."""
    return stats.binomtest(hits, CAMPAIGNS, share).pvalue > alpha


def _as_measured(end, offset, scale):
    """Return an end pose in the start frame as a camera sees it by markers at `offset`, with lengths scaled."""
    seen_end = end.compose(offset).relative_to(offset)
    return Pose(scale * seen_end.x_m, scale * seen_end.y_m, seen_end.heading_rad)


@pytest.mark.parametrize("key", ["camera_scale_ppm", "heading_alignment_deg", "marker_offset_mm"])
def test_sensitivities_to_small_sources_are_derivatives_of_the_mean_error(key):
    rng = np.random.default_rng(3)
    ends = scattered(rng, np.array([0.03, 0.01, 0.05]), np.array([0.01, 0.01, 0.02]), 6)

    def mean_mm(offset=NOWHERE, scale=1.0):
        moved = [_as_measured(end, offset, scale) for end in ends]
        return 1e3 * np.mean([math.dist(end[:2], TARGET[:2]) for end in moved])

    runs = [run_to(end, rng, noise_m=0.0, noise_rad=0.0) for end in ends]
    components = end_pose_budgets(runs, {key: Evaluation(1e-4, "normal")})[0].budget.components
    found = next(c for c in components if c.source == SOURCES[key][0])
    step = 1e-6
    expected = {
        "camera_scale_ppm": (mean_mm(scale=1.0 + step) - mean_mm(scale=1.0 - step)) / 2.0,
        "heading_alignment_deg": _slope(lambda d: mean_mm(Pose(0.0, 0.0, math.radians(d)))),
        "marker_offset_mm": math.hypot(
            _slope(lambda d: mean_mm(Pose(1e-3 * d, 0.0, 0.0))), _slope(lambda d: mean_mm(Pose(0.0, 1e-3 * d, 0.0)))
        ),
    }[key]
    assert found.contribution == pytest.approx(1e-4 * abs(expected), rel=1e-3)


def _slope(function, step=1e-4):
    return (function(step) - function(-step)) / (2.0 * step)


def test_noise_of_the_camera_is_in_the_scatter_of_repeats_and_not_added_to_it():
    rng = np.random.default_rng(0)
    across = np.array([0.02, -0.02, 0.0])
    runs = [run_to(end, rng, k) for k, end in enumerate(scattered(rng, across, 0.002, 8))]
    position, heading = (one.budget for one in end_pose_budgets(runs))
    errors = pose_errors(runs)
    assert position.estimate == pytest.approx(errors.position_mm.mean())
    assert heading.estimate == pytest.approx(errors.delta_heading_deg.mean())
    repeats = position.components[0]
    assert repeats.standard_uncertainty == pytest.approx(stats.sem(errors.position_mm))
    assert repeats.degrees_of_freedom == 7.0
    *noise, enlarged = [c for c in position.components if c.source.startswith("camera noise")]
    assert [c.role for c in noise] == [Role.IN_REPEATS] * 3
    assert [(c.evaluation, c.distribution) for c in noise] == [("A", "t")] * 3
    assert enlarged.role is Role.COMBINED
    assert enlarged.contribution < 0.01  # the target is ten times as far away as the cloud is wide
    # Poses that are known to 1 mrad per frame turn a target at 1.41 m by more than positions err.
    assert max(noise, key=lambda c: c.contribution).source == "camera noise: start heading"


def test_one_repeat_has_the_uncertainty_of_the_camera_only():
    rng = np.random.default_rng(0)
    (one, _) = end_pose_budgets([run_to(Pose(1.02, 1.01, 1.5), rng)])
    assert not one.budget.is_repeated
    assert one.budget.components[0].role is Role.NOT_STATED
    assert one.budget.combined > 0.0
    assert math.isfinite(one.budget.degrees_of_freedom)
    row = budget_table([one]).iloc[0]
    assert row[["coverage_factor", "expanded", "low", "high"]].isna().all()


def test_a_distance_is_not_negative():
    rng = np.random.default_rng(1)
    runs = [run_to(end, rng) for end in scattered(rng, 0.0, 0.002, 2)]
    position, heading = end_pose_budgets(runs, {"camera_position_mm": Evaluation(10.0, "normal")})
    assert position.interval[0] == 0.0
    assert position.interval[1] == pytest.approx(position.budget.estimate + position.budget.expanded)
    assert heading.interval[0] == pytest.approx(heading.budget.estimate - heading.budget.expanded)


def test_the_speed_of_a_vehicle_that_few_frames_saw_at_rest_is_not_taken_for_zero():
    rng = np.random.default_rng(0)
    runs = [run_to(Pose(1.02, 1.0, 1.5), rng) for _ in range(3)]
    seldom = [replace(run, frames=run.frames.select(np.arange(0, len(TIMES), 3))) for run in runs]
    for one in end_pose_budgets(seldom):
        clock = one.budget.components[-1]
        assert (clock.source, clock.role) == (SOURCES["clock_ms"][0], Role.NOT_STATED)
        assert clock.remark.startswith("too few frames at rest")
        assert key_to_state(clock) is None
        assert math.isfinite(one.budget.expanded)


def test_the_longest_delay_limits_the_error_of_capture_times():
    rng = np.random.default_rng(0)
    runs = [run_to(Pose(1.02, 1.0, 1.5), rng, delay_s=delay_s) for delay_s in (0.01, 0.04, math.nan)]
    clock = end_pose_budgets(runs)[0].budget.components[-1]
    assert clock.standard_uncertainty == pytest.approx(40.0 / math.sqrt(3.0))


def test_repeats_of_sessions_that_differ_are_as_many_as_the_sessions():
    rng = np.random.default_rng(2)
    shifts = {"monday": 0.004, "tuesday": -0.004, "friday": 0.0}
    runs = [
        replace(run_to(Pose(1.05 + shift, 1.0, 1.5), rng), session=name)
        for name, shift in shifts.items()
        for _ in "123"
    ]
    repeats = end_pose_budgets(runs)[0].budget.components[0]
    means = pose_errors(runs).groupby("session").position_mm.mean()
    assert repeats.standard_uncertainty == pytest.approx(stats.sem(means))
    assert repeats.degrees_of_freedom == 2.0
    alike = [replace(run, session="monday") for run in runs]
    assert end_pose_budgets(alike)[0].budget.components[0].degrees_of_freedom == 8.0


def test_latency_moves_nothing_at_rest_and_much_on_a_vehicle_that_creeps():
    rng = np.random.default_rng(0)
    (still, _) = end_pose_budgets([run_to(Pose(1.02, 1.0, 1.5), rng, delay_s=0.05) for _ in range(3)])
    creeping = []
    for run in [run_to(Pose(1.02, 1.0, 1.5), rng, delay_s=0.05) for _ in range(3)]:
        drift = np.where(run.frames.t_s > 0.0, 0.015 * run.frames.t_s, 0.0)
        creeping.append(replace(run, frames=replace(run.frames, x_m=run.frames.x_m + drift)))
    (moves, _) = end_pose_budgets(creeping)
    quiet, loud = (
        next(c for c in one.budget.components if c.source == SOURCES["clock_ms"][0]) for one in (still, moves)
    )
    assert quiet.standard_uncertainty == pytest.approx(50.0 / math.sqrt(3.0))
    assert quiet.contribution < 0.05
    assert loud.contribution == pytest.approx(15.0 * 0.05 / math.sqrt(3.0), rel=0.15)


def test_what_the_lab_does_not_state_is_listed_and_not_combined():
    rng = np.random.default_rng(0)
    budgets = end_pose_budgets([run_to(end, rng) for end in scattered(rng, 0.01, 0.002, 4)])
    table = component_table(budgets)
    lacking = table[table.role == "not stated"]
    assert set(lacking.remark) == {f"state {key} in [uncertainty]" for key in SOURCES if key != "clock_ms"}
    assert lacking.contribution.isna().all()
    summary = budget_table(budgets)
    assert list(summary.not_stated) == [5, 1]
    row = summary.iloc[0]
    assert (row.low, row.high) == pytest.approx((row["mean"] - row.expanded, row["mean"] + row.expanded))


def test_effective_degrees_of_freedom_and_factor_of_the_gum():
    # JCGM 100:2008, example H.1 (end gauge): u = 32 nm, k for 99 % with 16 degrees of freedom is 2.92.
    parts = [(25.0, 18.0), (5.8, 24.0), (3.9, 5.0), (6.7, 8.0), (2.9, 50.0), (16.6, 2.0)]
    budget = Budget(0.0, "nm", [Component("", "B", "normal", u, "nm", 1.0, freedom) for u, freedom in parts])
    assert budget.combined == pytest.approx(32.0, abs=0.6)
    assert math.floor(budget.degrees_of_freedom) == 16
    assert stats.t.ppf(0.995, 16) == pytest.approx(2.92, abs=0.005)
    assert budget.coverage_factor == pytest.approx(stats.t.ppf(0.975, budget.degrees_of_freedom))
    known = Budget(0.0, "nm", [Component("", "B", "normal", 1.0, "nm", 2.0, math.inf)])
    assert (known.combined, known.coverage_factor) == (2.0, pytest.approx(1.959964, abs=1e-6))


@pytest.mark.parametrize(("failures", "total"), [(0, 1), (0, 10), (2, 10), (9, 10), (10, 10)])
def test_failure_bound_solves_the_binomial_tail(failures, total):
    bound = failure_bound(failures, total)
    if failures == 0:
        assert bound == pytest.approx(1.0 - 0.05 ** (1.0 / total))
    if failures == total:
        assert bound == 1.0
    else:
        assert stats.binom.cdf(failures, total, bound) == pytest.approx(0.05)
    assert math.isnan(failure_bound(0, 0))


def test_aborted_runs_of_other_programs_are_failures_and_rejected_ones_no_attempts():
    rng = np.random.default_rng(0)
    statuses = ["ok"] * 7 + ["aborted: left the workspace", "rejected: gap"]
    runs = [replace(run_to(TARGET, rng, k), status=status) for k, status in enumerate(statuses)]
    (row,) = completions(pose_errors(runs)).to_dict("records")
    assert (row["attempts"], row["not_completed"], row["left_out"]) == (8, 1, 1)
    assert row["failure_bound"] == pytest.approx(stats.beta.ppf(0.95, 2, 7))


def test_pose_accuracy_and_repeatability():
    points = np.array([[1.0, 0.0], [5.0, 0.0], [3.0, 2.0], [3.0, -2.0]])
    table = pd.DataFrame(
        {"trajectory": "5", "condition": "calibrated", "status": "ok", "problem": "", "along_mm": points[:, 0],
         "across_mm": points[:, 1] + 4.0, "delta_heading_deg": [1.0, 2.0, 3.0, 2.0]}
    )  # fmt: skip
    (row,) = pose_accuracies(table).to_dict("records")
    assert (row["ap_mm"], row["mean_radius_mm"], row["rp_mm"]) == (5.0, 2.0, 2.0)  # on a circle: S is zero
    assert (row["ap_deg"], row["rp_deg"]) == (2.0, pytest.approx(3.0 * math.sqrt(2.0 / 3.0)))
    one = pose_accuracies(table.head(1)).iloc[0]
    assert one.ap_mm == pytest.approx(math.hypot(1.0, 4.0))
    assert math.isnan(one.rp_mm)


def test_a_vehicle_that_never_came_to_rest_did_not_complete_its_attempt():
    rng = np.random.default_rng(0)
    run = run_to(TARGET, rng)
    moves = replace(run.frames, x_m=run.frames.x_m + np.where(run.frames.t_s > 0.0, 0.5 * run.frames.t_s, 0.0))
    unseen = replace(run.frames, tracked=run.frames.t_s < 0.0)
    runs = [run, replace(run, frames=moves), replace(run, frames=unseen)]
    (row,) = completions(pose_errors(runs)).to_dict("records")
    assert (row["attempts"], row["not_completed"], row["left_out"]) == (2, 1, 1)


@pytest.mark.parametrize("repeats", [1, 2])
def test_fewer_than_three_repeats_have_no_repeatability(repeats):
    points = np.array([[1.0, 0.0], [5.0, 1.0]])[:repeats]
    assert math.isnan(pose_accuracy(points)[2])


@pytest.mark.parametrize(("repeats", "share"), [(5, 0.845), (10, 0.93), (30, 0.98)])
def test_fewer_repeats_give_a_smaller_repeatability(repeats, share):
    rng = np.random.default_rng(0)
    found = np.mean([pose_accuracy(points)[2] for points in rng.normal(size=(CAMPAIGNS, repeats, 2))])
    rayleigh = stats.rayleigh()
    assert found == pytest.approx(share * (rayleigh.mean() + 3.0 * rayleigh.std()), rel=0.02)


def test_prediction_ellipse_holds_95_percent_of_further_points():
    rng = np.random.default_rng(5)
    shape = np.array([[3.0, 1.0], [0.0, 0.5]])
    hits = 0
    for _ in range(CAMPAIGNS):
        *points, further = rng.normal(size=(7, 2)) @ shape
        centre, axes = prediction_ellipse(np.array(points))
        hits += np.sum(np.linalg.solve(axes, further - centre) ** 2) <= 1.0
    assert within_binomial_bounds(hits)
    assert prediction_ellipse(np.zeros((3, 2))) is None
    assert prediction_ellipse(np.column_stack([np.arange(9.0), np.arange(9.0)])) is None


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"camera_positon_mm": 0.3}, "lab.toml: uncertainty: unknown key 'camera_positon_mm'"),
        ({"camera_position_mm": -0.3}, "lab.toml: uncertainty: camera_position_mm"),
        ({"clock_ms": {}}, "lab.toml: uncertainty.clock_ms: states neither or both of standard and half_width"),
        ({"clock_ms": {"standard": 1.0, "half_width": 2.0}}, "states neither or both"),
        ({"clock_ms": float("nan")}, "lab.toml: uncertainty: clock_ms"),
        (5, "lab.toml: uncertainty"),
    ],
)
def test_a_statement_that_cannot_be_used_is_one_line(table, said):
    with pytest.raises(FileError, match=r"docs/reference/report\.md#uncertainty") as error:
        read_statement(table, "lab.toml", FileError)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_statement_becomes_evaluations():
    table = {"camera_scale_ppm": 200, "clock_ms": {"half_width": 5.0, "degrees_of_freedom": 8}}
    found = evaluations(read_statement(table, "lab.toml", FileError))
    assert found["camera_scale_ppm"] == Evaluation(200.0, "normal")
    assert found["clock_ms"].standard_uncertainty == pytest.approx(5.0 / math.sqrt(3.0))
    assert found["clock_ms"].degrees_of_freedom == 8.0


def test_noise_that_one_frame_at_rest_does_not_show_is_not_stated():
    rng = np.random.default_rng(2)
    ends = scattered(rng, np.array([0.003, 0.0, 0.0]), 0.005, 10)
    runs = [_with_one_frame_at_rest(run_to(end, rng, k)) for k, end in enumerate(ends)]
    position = end_pose_budgets(runs)[0].budget
    roles = {c.role for c in position.components if c.source.startswith("camera noise")}
    assert roles == {Role.NOT_STATED}


def _with_one_frame_at_rest(run):
    before, after = np.flatnonzero(run.frames.t_s < 0.0)[-1:], np.flatnonzero(run.frames.t_s > 0.0)[-1:]
    return replace(run, frames=run.frames.select(np.r_[before, after]))
