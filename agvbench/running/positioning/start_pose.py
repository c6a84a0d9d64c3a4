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
PROGRESS_S = 2.0
PATIENCE_S = 600.0


@dataclass(frozen=True)
class _StartCheck:
    """How far from the start the vehicle is, in words, and whether that will do."""

    said: str
    good: bool


def notify_operator(text: str) -> None:
    """Print to the operator, over a line of progress that may be there."""
    to = sys.__stderr__
    print(f"\r\x1b[K{text}" if to is not None and to.isatty() else text, file=to, flush=True)


def wait_for_start(
    link: RunnerLink,
    neutral: Command,
    start: Pose,
    *,
    limits: QualityLimits = DEFAULT_LIMITS,
    patience_s: float = PATIENCE_S,
    on_progress: Callable[[str], None] = notify_operator,
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
    check = partial(_place, start=start, limits=limits)
    place = _wait(link, neutral, check, asked, patience_s=patience_s, on_progress=on_progress)
    if not place.good:
        raise PlacingError(
            "the vehicle was not put at the start", where=link.keys.root, value=place.said, limit=f"{patience_s:g} s",
            remedy="go on with --resume",
        )  # fmt: skip


def wait_until_seen(
    link: RunnerLink,
    neutral: Command,
    *,
    patience_s: float = PATIENCE_S,
    on_progress: Callable[[str], None] = notify_operator,
) -> None:
    """Wait until the vehicle is seen anywhere, for at most `patience_s` [s]."""
    _wait(
        link,
        neutral,
        _anywhere,
        f"waiting for {link.identity().vehicle}",
        patience_s=patience_s,
        on_progress=on_progress,
    )


def _wait(
    link: RunnerLink,
    neutral: Command,
    check: Callable[[Frames, float, str], _StartCheck],
    asked: str,
    *,
    patience_s: float,
    on_progress: Callable[[str], None],
) -> _StartCheck:
    """Let the vehicle stand until `check` accepts its place; report every `PROGRESS_S`; return its last place."""
    waited_s, reported_s, place = 0.0, -math.inf, _StartCheck("", False)
    while waited_s < patience_s:
        # The run's clock begins anew at its first exchange, which is before any of these.
        frames = link.control_cycle(neutral, t_s=waited_s, hold_s=LOOK_S)
        waited_s += LOOK_S
        place = check(frames, waited_s, link.identity().mocap.adapter)
        if place.good:
            break
        if waited_s - reported_s >= PROGRESS_S:
            on_progress(f"{asked}: {place.said}")
            reported_s = waited_s
    return place


def _unseen(frames: Frames, camera: str) -> str:
    """Say why there is no pose: a stream that is missing has other remedies than a vehicle out of view."""
    if not len(frames):
        return f"no frame arrived from {camera}; start its stream, or see address, port and firewall"
    rate_hz = len(frames) / LOOK_S
    return f"it is not seen: {rate_hz:.0f} frames/s arrive from {camera}, but without the vehicle"


def _anywhere(frames: Frames, now_s: float, camera: str) -> _StartCheck:
    if pose_before(frames, now_s) is None:
        return _StartCheck(_unseen(frames, camera), False)
    return _StartCheck("it is seen", True)


def _place(frames: Frames, now_s: float, camera: str, start: Pose, limits: QualityLimits) -> _StartCheck:
    found = pose_before(frames, now_s)
    if found is None:
        return _StartCheck(_unseen(frames, camera), False)
    off_m = math.dist(found[:2], start[:2])
    off_rad = abs(wrap_angle(found.heading_rad - start.heading_rad))
    said = f"it is {off_m * 1e3:.0f} mm and {math.degrees(off_rad):.1f}° off"
    if not is_at_rest(frames, until_s=now_s):
        return _StartCheck(f"{said}, and moving", False)
    return _StartCheck(said, off_m <= limits.start_position_m / 2.0 and off_rad <= limits.start_heading_rad / 2.0)
