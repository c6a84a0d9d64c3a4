"""Wait until a real vehicle stands at the start pose, and say how far off it is."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from agvbench.errors import PlacingError
from agvbench.running.links import RunnerLink
from agvbench.running.quality import DEFAULT_LIMITS, QualityLimits
from agvbench.running.rest_detection import is_at_rest, pose_before
from agvbench.types import Command, Frames, Pose, wrap_angle

LOOK_S = 0.5
TELL_S = 2.0
PATIENCE_S = 600.0


@dataclass(frozen=True)
class _Place:
    """How far from the start the vehicle is, in words, and whether that will do."""

    said: str
    good: bool


def say(text: str) -> None:
    """Tell the operator, over a line of progress that may be there."""
    to = sys.__stderr__
    print(f"\r\x1b[K{text}" if to is not None and to.isatty() else text, file=to, flush=True)


def wait_for_start(
    link: RunnerLink,
    neutral: Command,
    start: Pose,
    *,
    limits: QualityLimits = DEFAULT_LIMITS,
    patience_s: float = PATIENCE_S,
    tell: Callable[[str], None] = say,
) -> None:
    """Wait until the vehicle is seen at rest at `start` (floor frame), within half of what a run may be off.

    Raises
    ------
    PlacingError
        If it is not there after `patience_s` [s].
    """
    x_m, y_m, heading_rad = start
    where = f"x = {x_m:.3f} m, y = {y_m:.3f} m, heading {math.degrees(heading_rad):.1f}°"
    asked = f"put {link.identity().vehicle} at {where}"
    judge = partial(_place, start=start, limits=limits)
    place = _wait(link, neutral, judge, asked, patience_s=patience_s, tell=tell)
    if not place.good:
        raise PlacingError(
            "the vehicle was not put at the start", where=link.keys.root, value=place.said, limit=f"{patience_s:g} s",
            remedy="go on with --resume",
        )  # fmt: skip


def wait_until_seen(
    link: RunnerLink, neutral: Command, *, patience_s: float = PATIENCE_S, tell: Callable[[str], None] = say
) -> None:
    """Wait until the vehicle is seen anywhere, for at most `patience_s` [s]."""
    _wait(link, neutral, _anywhere, f"waiting for {link.identity().vehicle}", patience_s=patience_s, tell=tell)


def _wait(
    link: RunnerLink,
    neutral: Command,
    judge: Callable[[Frames, float], _Place],
    asked: str,
    *,
    patience_s: float,
    tell: Callable[[str], None],
) -> _Place:
    """Let the vehicle stand until `judge` finds its place good, and tell every `TELL_S`; return its last place."""
    waited_s, told_s, place = 0.0, -math.inf, _Place("", False)
    while waited_s < patience_s:
        # The run's clock begins anew at its first exchange, which is before any of these.
        frames = link.exchange(neutral, t_s=waited_s, hold_s=LOOK_S)
        waited_s += LOOK_S
        place = judge(frames, waited_s)
        if place.good:
            break
        if waited_s - told_s >= TELL_S:
            tell(f"{asked}: {place.said}")
            told_s = waited_s
    return place


def _anywhere(frames: Frames, now_s: float) -> _Place:
    return _Place("it is not seen", good=pose_before(frames, now_s) is not None)


def _place(frames: Frames, now_s: float, start: Pose, limits: QualityLimits) -> _Place:
    found = pose_before(frames, now_s)
    if found is None:
        return _Place("it is not seen", False)
    off_m = math.dist(found[:2], start[:2])
    off_rad = abs(wrap_angle(found.heading_rad - start.heading_rad))
    said = f"it is {off_m * 1e3:.0f} mm and {math.degrees(off_rad):.1f}° off"
    if not is_at_rest(frames, until_s=now_s):
        return _Place(f"{said}, and moving", False)
    return _Place(said, off_m <= limits.start_position_m / 2.0 and off_rad <= limits.start_heading_rad / 2.0)
