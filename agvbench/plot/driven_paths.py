"""The ways that were driven, from a common start, beside what was planned."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from agvbench.campaign.arguments import as_runs
from agvbench.errors import InputError
from agvbench.metrics.measured_run import in_start_frame, smooth_poses
from agvbench.plot.style import ON_WHITE, Ink, colour, condition_numbers, label, literal, trajectory_title
from agvbench.types import Floats, Frames, Pose, Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from agvbench.planning import Plan

ARROW_M = 0.22
_FEWEST_POINTS, _MOST_POINTS, _POINTS_PER_M = 80, 600, 20.0


def paths(axes: Axes, runs: Iterable[Run] | Run | str | PathLike[str], plan: Plan | None = None) -> Axes:
    """Draw the paths that `runs` drove in their start frame, by condition, and beside them what was planned.

    The hollow mark is the start, the filled one the target with its heading.

    Parameters
    ----------
    axes
        Where to draw [m].
    runs
        Runs of one trajectory, such as ``campaign.select(trajectory="5")``, or one run.
    plan
        What `agvbench.plan` returned; its expected path is dashed.

    Raises
    ------
    InputError
        If `runs` are none, or no run has frames to draw.
    """
    driven = [(run, path) for run in as_runs(runs) if len(path := drawn_path(run.frames)) > 1]
    if not driven:
        raise InputError("no run has frames to draw", remedy="choose runs with campaign.select")
    numbers = condition_numbers(list(dict.fromkeys(run.condition for run, _ in driven)))
    label(axes, x="x [m]", y="y [m]", title=trajectory_title(driven[0][0].trajectory))
    for name, number in numbers.items():
        group = [from_start(path)[:, 1:3] for run, path in driven if run.condition == name]
        draw_group(axes, group, number, label=literal(name) or "no condition")
    if plan is not None:
        axes.plot(plan.expected[:, 1], plan.expected[:, 2], color=ON_WHITE.ink, linestyle="--", label="planned")
    target = driven[0][0].target if plan is None else plan.target
    draw_start_and_target(axes, target, ON_WHITE)
    axes.update_datalim([tip(pose) for pose in (Pose(0.0, 0.0, 0.0), target) if pose.is_finite])
    axes.autoscale_view()
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend()
    return axes


def drawn_path(frames: Frames) -> Floats:
    """Return poses spread evenly over the way driven, shape (n, 4): t [s], x, y [m], heading [rad].

    There is one every 50 mm, but at least 80 in all (if there are so many) and at most 600.

    Frames that are not tracked, or lie more than 0.1 m from the median of the five around them, are left out: this is
    for looking at, not for measuring.
    """
    poses = smooth_poses(frames)
    if len(poses) <= _FEWEST_POINTS:
        return poses
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(poses[:, 1]), np.diff(poses[:, 2])))])
    wanted = np.linspace(0.0, way[-1], int(np.clip(way[-1] * _POINTS_PER_M, _FEWEST_POINTS, _MOST_POINTS)))
    return np.asarray(poses[np.unique(np.searchsorted(way, wanted).clip(0, len(poses) - 1))])


def from_start(path: Floats) -> Floats:
    """Return a path, shape (n, 4): t [s], x, y [m], heading [rad], in its start frame.

    The first poses' median stands for the start.
    """
    at_rest = path[path[:, 0] <= 0.0]
    _, *start = np.median(at_rest if len(at_rest) else path[:1], axis=0).tolist()
    return in_start_frame(path, Pose(*start))


def draw_group(axes: Axes, group: Sequence[Floats], index: int, label: str | None = None) -> None:
    """Draw paths, shape (n, 2) or more with x, y [m] first, of the condition with this number."""
    line = _joined(group)
    axes.plot(
        line[:, 0], line[:, 1], color=colour(index), linewidth=0.9, alpha=0.75, solid_capstyle="round", label=label
    )


def draw_start_and_target(axes: Axes, target: Pose, ink: Ink) -> None:
    """Mark the start, at the origin, and the target with their headings; a target of NaN is none."""
    _mark(axes, Pose(0.0, 0.0, 0.0), ink.muted, ink.paper)
    if target.is_finite:
        _mark(axes, target, ink.ink, ink.ink)


def tip(pose: Pose) -> tuple[float, float]:
    """Return where the arrow of a marked pose ends [m]."""
    return pose.x_m + ARROW_M * math.cos(pose.heading_rad), pose.y_m + ARROW_M * math.sin(pose.heading_rad)


def _joined(group: Sequence[Floats]) -> Floats:
    """Return many paths as one line with gaps, which is drawn many times faster."""
    gap = np.full((1, 2), np.nan)
    return np.concatenate([piece for path in group for piece in (path[:, :2], gap)] or [gap])


def _mark(axes: Axes, pose: Pose, ink: str, inside: str) -> None:
    arrow = {"arrowstyle": "->", "color": ink, "linewidth": 1.1, "shrinkA": 0}
    axes.annotate("", tip(pose), pose[:2], arrowprops=arrow)
    axes.plot(*pose[:2], marker="o", markersize=5, color=ink, markerfacecolor=inside, zorder=5)
