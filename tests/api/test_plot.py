"""`agvbench.plot`: draws on the axes that it is given, returns them, and touches nothing else."""

from __future__ import annotations

import dataclasses
import itertools
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import agvbench
from agvbench.errors import InputError
from agvbench.planning import load_trajectory


@pytest.fixture(scope="module")
def errors(campaign):
    return agvbench.pose_errors(campaign)


@pytest.fixture(scope="module")
def calibration(campaign):
    return agvbench.calibrate(campaign)


@pytest.fixture(scope="module")
def compared(errors):
    conditions = ("uncalibrated", "calibrated")
    return agvbench.compare(errors, errors, conditions=conditions, same_campaign=True, names=conditions)


@pytest.fixture(scope="module")
def diagnosis():
    time_s = np.tile(np.linspace(0.0, 6.0, 80), 4)
    table = pd.DataFrame({"time_in_run_s": time_s, "before_speed": 0.02 * time_s, "after_speed": 0.0 * time_s})
    return agvbench.Diagnosis(agvbench.Verdict.NAMED, "", residuals=table)


def legend(axes):
    return [text.get_text() for text in axes.get_legend().get_texts()]


def points(axes):
    """Return everything drawn as lines and marks, (n, 2)."""
    return np.concatenate([np.column_stack(line.get_data()) for line in axes.get_lines() if len(line.get_xdata())])


def drawn(axes):
    """Render the figure, where a name that is taken for a formula would raise."""
    axes.figure.draw_without_rendering()
    return axes


def test_end_poses_are_seen_from_the_target_in_mm(axes, errors, hostile):
    assert agvbench.plot.end_poses(axes, errors, trajectory=hostile) is axes
    assert legend(drawn(axes)) == ["target", "uncalibrated", "calibrated"]
    assert axes.get_xlabel() == "ahead of target [mm]"
    farthest = errors["position_mm"].max()
    assert farthest < axes.get_xlim()[1] < 2.0 * farthest


def test_a_trajectory_that_was_not_driven_is_named_with_those_that_were(axes, errors):
    with pytest.raises(InputError, match=r"no run of this trajectory counts: '9' \(one of: <script>"):
        agvbench.plot.end_poses(axes, errors, trajectory="9")


def test_paths_begin_at_the_origin_and_lead_to_the_target(axes, campaign, calibration, hostile):
    plan = agvbench.plan(load_trajectory("5"), calibration.model)
    assert agvbench.plot.paths(axes, campaign.select(trajectory=hostile), plan) is axes
    assert legend(drawn(axes)) == ["uncalibrated", "calibrated", "planned"]
    xy = points(axes)
    xy = xy[np.isfinite(xy).all(axis=1)]
    assert np.hypot(*(xy - plan.target[:2]).T).min() < 1e-6
    assert np.abs(xy).max() < 1.5
    assert axes.get_ylim()[1] > 1.2, "the arrow of the target is inside"


def test_runs_without_a_frame_are_no_figure(axes):
    with pytest.raises(InputError, match="no run has frames to draw"):
        agvbench.plot.paths(axes, [])


@pytest.mark.parametrize("axle", ["front", "rear", "drive"])
def test_calibration_curves_go_through_what_was_measured(axes, calibration, axle):
    assert agvbench.plot.calibration_curve(axes, calibration, axle) is axes
    drawn(axes)
    rows = calibration.measurements[calibration.measurements["axle"] == axle]
    curve = np.column_stack(axes.get_lines()[0].get_data())
    at = np.interp(rows["command"], curve[:, 0], curve[:, 1])
    assert np.abs(at - rows["value"])[~rows["left_out"].to_numpy()].max() < (0.02 if axle == "drive" else 0.5)
    assert axes.get_xlabel() == "command [µs]"


def test_an_axle_that_is_none_is_told(axes, calibration):
    with pytest.raises(InputError, match="axle: nothing was measured: 'middle'"):
        agvbench.plot.calibration_curve(axes, calibration, "middle")


def test_residuals_are_drawn_before_and_after_in_per_cent(axes, diagnosis):
    assert agvbench.plot.residuals(axes, diagnosis) is axes
    assert legend(drawn(axes)) == ["before", "after"]
    assert points(axes)[:, 1].max() == pytest.approx(12.0, rel=0.1)


@pytest.mark.parametrize(
    ("changes", "asked", "said"),
    [
        ({"residuals": None}, {}, "the diagnosis has no residuals: NAMED; see diagnosis.why"),
        ({}, {"feature": "height"}, "feature: cannot be drawn: 'height'"),
        ({}, {"against": "moon"}, "against: cannot be drawn: 'moon'"),
    ],
)
def test_residuals_that_are_not_there_are_told(axes, diagnosis, changes, asked, said):
    with pytest.raises(InputError, match=said):
        agvbench.plot.residuals(axes, dataclasses.replace(diagnosis, **changes), **asked)


def test_a_comparison_shows_interval_margin_and_verdict(axes, compared, hostile):
    assert agvbench.plot.comparison(axes, compared) is axes
    drawn(axes)
    (name,) = (text.get_text() for text in axes.get_yticklabels())
    assert name.startswith(hostile.replace("$", r"\$"))
    assert axes.get_xlabel() == "end position error [mm]"
    with pytest.raises(InputError, match="quantity: was not compared: 'luck'"):
        agvbench.plot.comparison(axes, compared, quantity="luck")


@pytest.fixture(scope="module")
def seventeen(compared):
    """Eight trajectories under two conditions, and all of them."""
    first = compared.differences[0]
    cells = [(str(n), condition) for n in range(1, 9) for condition in ("uncalibrated", "calibrated")]
    rows = [dataclasses.replace(first, trajectory=t, condition=c) for t, c in [*cells, ("all trajectories", "all")]]
    return dataclasses.replace(compared, differences=tuple(rows))


def test_seventeen_comparisons_are_readable_at_the_default_size(seventeen):
    axes = Figure(layout="constrained").add_subplot()
    agvbench.plot.comparison(axes, seventeen)
    drawn(axes)
    names = axes.get_yticklabels()
    assert [name.get_text() for name in names][-2:] == ["8, calibrated", "all trajectories"]
    assert min(text.get_fontsize() for text in [*names, *axes.texts]) > 7.0
    for column in (names, axes.texts):
        boxes = sorted((text.get_window_extent() for text in column), key=lambda box: box.y0)
        assert len(boxes) == 17
        assert all(below.y1 <= above.y0 for below, above in itertools.pairwise(boxes))
        page = axes.figure.bbox
        assert all(page.x0 <= box.x0 and box.x1 <= page.x1 for box in boxes)


def test_medians_are_hollow_and_the_title_says_what_the_number_is(axes, errors, campaign):
    renamed = errors.assign(trajectory="5")
    agvbench.plot.end_poses(axes, renamed, trajectory="5")
    assert axes.get_title() == "trajectory 5"
    medians = [line for line in axes.get_lines() if len(line.get_xdata()) == 1 and line.get_marker() in {"o", "s"}]
    assert [line.get_markerfacecolor() for line in medians] == ["none", "none"]
    runs = [dataclasses.replace(run, trajectory="5") for run in campaign.select(experiment="trajectory")]
    assert agvbench.plot.paths(Figure().add_subplot(), runs).get_title() == "trajectory 5"


def test_matplotlib_is_imported_by_whoever_makes_the_axes():
    code = "import sys, agvbench; agvbench.plot.paths; print('matplotlib' in sys.modules)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "False"
