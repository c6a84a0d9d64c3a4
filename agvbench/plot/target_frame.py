"""Where runs ended, seen from where they should have ended."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from agvbench.campaign.names import as_text
from agvbench.errors import InputError, OneOf
from agvbench.plot.style import ON_WHITE, Ink, colour, condition_numbers, label, literal, marker, trajectory_title
from agvbench.statistics import valid
from agvbench.statistics.run_errors import as_errors
from agvbench.types import Floats, Pose, Run

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

_POSE = ("x_m", "y_m", "heading_rad")


def end_poses(axes: Axes, errors: pd.DataFrame | Iterable[Run] | str | PathLike[str], *, trajectory: str) -> Axes:
    """Draw the end poses of one trajectory in the frame of its target, by condition.

    The cross is the target position and the arrow its heading. The short line of each end pose is its heading; large
    hollow markers are medians.

    Parameters
    ----------
    axes
        Where to draw [mm].
    errors
        A campaign, its directory, or what `agvbench.pose_errors` returns; runs that do not count are not drawn.
    trajectory
        The trajectory's name.

    Raises
    ------
    InputError
        If `errors` are none, the name is not text, or no run of this trajectory counts.
    CampaignError
        If the campaign cannot be read.
    """
    as_text(trajectory, where="trajectory")
    counted = valid(as_errors(errors, where="errors"))
    rows = counted[counted["trajectory"] == trajectory]
    if rows.empty:
        known = OneOf(dict.fromkeys(counted["trajectory"]))
        raise InputError("no run of this trajectory counts", value=repr(trajectory), limit=known)
    numbers = condition_numbers([str(condition) for condition in dict.fromkeys(rows["condition"])])
    ends = {number: in_target_frame(rows[rows["condition"] == name]) for name, number in numbers.items()}
    label(axes, x="ahead of target [mm]", y="left of target [mm]", title=trajectory_title(trajectory))
    half = draw_ends(axes, ends, ON_WHITE)
    axes.plot(0.0, 0.0, marker="+", markersize=12, color=ON_WHITE.ink, linestyle="none", label="target")
    axes.annotate("", (0.3 * half, 0.0), (0.0, 0.0), arrowprops={"arrowstyle": "->", "color": ON_WHITE.ink})
    for name, number in numbers.items():
        axes.plot([], [], marker=marker(number), color=colour(number), linestyle="none", label=literal(name))
    axes.legend()
    return axes


def in_target_frame(rows: pd.DataFrame) -> Floats:
    """Return mm ahead of the target, mm to its left and the heading error [rad], shape (n, 3)."""
    ends, targets = (rows[[f"{side}_{axis}" for axis in _POSE]].to_numpy(dtype=float) for side in ("end", "target"))
    seen = [Pose(*end).relative_to(Pose(*target)) for end, target in zip(ends, targets, strict=True)]
    return np.array([[1e3 * x, 1e3 * y, heading] for x, y, heading in seen]).reshape(-1, 3)


def ends_by_condition(rows: pd.DataFrame, numbers: Mapping[str, int]) -> dict[int, Floats]:
    """Return what `in_target_frame` does by the number of the condition, of those that have rows."""
    ends = {number: in_target_frame(rows[rows["condition"] == name]) for name, number in numbers.items()}
    return {number: points for number, points in ends.items() if len(points)}


def draw_ends(axes: Axes, ends: Mapping[int, Floats], ink: Ink) -> float:
    """Draw end poses with their medians, in a square about the target; return half its width [mm].

    Parameters
    ----------
    axes
        Where to draw.
    ends
        By the number of the condition: shape (n, 3), mm ahead of the target, mm to its left, heading error [rad].
    ink
        Colours of everything but the points.
    """
    axes.axhline(0.0, color=ink.muted, linewidth=0.7)
    axes.axvline(0.0, color=ink.muted, linewidth=0.7)
    half = _half_width(ends)
    for index, points in ends.items():
        _points(axes, points, index, ink, tick=0.09 * half)
        middle = np.median(points[:, :2], axis=0)
        axes.plot(
            *middle,
            marker=marker(index),
            markersize=11,
            markerfacecolor="none",  # the repeats that it is the median of stay visible
            markeredgecolor=colour(index),
            markeredgewidth=1.5,
        )
    axes.set_xlim(-half, half)
    axes.set_ylim(-half, half)
    axes.set_aspect("equal", adjustable="box")
    return half


def _points(axes: Axes, points: Floats, index: int, ink: Ink, *, tick: float) -> None:
    tips = points[:, :2] + tick * np.column_stack([np.cos(points[:, 2]), np.sin(points[:, 2])])
    gap = np.full((len(points), 1), np.nan)
    x, y = (np.column_stack([points[:, axis], tips[:, axis], gap]).ravel() for axis in (0, 1))
    axes.plot(x, y, color=colour(index), linewidth=0.9)
    axes.plot(
        points[:, 0],
        points[:, 1],
        linestyle="none",
        marker=marker(index),
        markersize=4,
        color=colour(index),
        markeredgecolor=ink.paper,
        markeredgewidth=0.5,
    )


def _half_width(ends: Mapping[int, Floats]) -> float:
    """Return half the width [mm] of a square about the target in which every point lies, at least 5 mm."""
    farthest = max((float(np.abs(points[:, :2]).max()) for points in ends.values()), default=0.0)
    return 1.15 * max(5.0, farthest)
