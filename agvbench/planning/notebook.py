"""How a notebook shows a trajectory."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from agvbench.notebook_html import heading_html, table_html

if TYPE_CHECKING:
    from agvbench.planning.trajectories.trajectory import Trajectory

_MOST = 12


def trajectory_html(trajectory: Trajectory) -> str:
    """Return what it says of itself, how it is driven, and its segments with what each of them sets."""
    line = (
        f"{trajectory.shape.replace('_', ' ')}; speed {trajectory.speed}, steering {trajectory.steering}, "
        f"conditions {', '.join(trajectory.conditions)}"
    )
    segments = trajectory.expand()
    rows = [(str(index), *_row(segment)) for index, segment in enumerate(segments[:_MOST])]
    rows += [("…", f"{len(segments) - _MOST} more", "")] if len(segments) > _MOST else []
    return heading_html(trajectory.name, trajectory.description, line) + table_html(
        "segments", ["", "kind", "sets"], rows
    )


def _row(segment: msgspec.Struct) -> tuple[str, str]:
    table = msgspec.to_builtins(segment)
    kind = str(table.pop("kind", type(segment).__name__))
    return kind, ", ".join(f"{name} = {_short(value)}" for name, value in table.items() if value is not None)


def _short(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
