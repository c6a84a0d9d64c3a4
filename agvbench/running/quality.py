"""Does a run count? Tracked share, gaps, start pose, rest at both ends, and what adapters reported meanwhile."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from agvbench.bus.messages.event import NOT_AS_PLANNED, Event, Level
from agvbench.campaign.attempts import STILL_MOVING
from agvbench.running.rest_detection import is_at_rest, pose_before
from agvbench.types import RUN_OK, Frames, Outcome, Pose, RunStatus, wrap_angle


@dataclass(frozen=True)
class QualityLimits:
    """What a run must keep to count: shares, seconds, metres and radians."""

    tracked_share: float = 0.9
    gap_s: float = 0.25
    start_position_m: float = 0.02
    start_heading_rad: float = math.radians(2.0)


DEFAULT_LIMITS = QualityLimits()


@dataclass(frozen=True)
class Quality:
    """What was seen of a run; NaN where there is nothing to see."""

    tracked_share: float
    longest_gap_s: float
    start_position_error_m: float
    start_heading_error_rad: float
    rests_before: bool
    rests_after: bool

    def status(self, limits: QualityLimits = DEFAULT_LIMITS) -> str:
        """Return ``"ok"``, or ``"rejected: WHY"`` with the first limit that is broken."""
        return next((str(RunStatus(Outcome.REJECTED, complaint)) for complaint in self._complaints(limits)), RUN_OK)

    def _complaints(self, limits: QualityLimits) -> Iterator[str]:
        # Written as "not within" so that NaN, nothing seen, is a complaint too.
        if not self.tracked_share >= limits.tracked_share:
            yield f"tracked share {self.tracked_share:.2f} (limit: at least {limits.tracked_share:.2f})"
        if not self.longest_gap_s <= limits.gap_s:
            yield f"gap of {self.longest_gap_s:.2f} s without pose (limit: {limits.gap_s:.2f} s)"
        if not self.start_position_error_m <= limits.start_position_m:
            off_mm, limit_mm = self.start_position_error_m * 1e3, limits.start_position_m * 1e3
            yield f"start {off_mm:.1f} mm off (limit: {limit_mm:.0f} mm)"
        if not self.start_heading_error_rad <= limits.start_heading_rad:
            off_deg, limit_deg = math.degrees(self.start_heading_error_rad), math.degrees(limits.start_heading_rad)
            yield f"start heading {off_deg:.1f}° off (limit: {limit_deg:.1f}°)"
        if not self.rests_before:
            yield "moving before the first command"
        if not self.rests_after:
            yield STILL_MOVING


def not_as_planned(events: Sequence[Event]) -> Event | None:
    """Return the event that says best why a run was not driven as it was planned; None if none does.

    An error is one, too. Of several of a kind it is the last: of gaps between commands the longest.
    """
    rank = {kind: number for number, kind in enumerate(NOT_AS_PLANNED)}
    found = [event for event in events if event.kind in rank or event.level is Level.ERROR]
    return min(reversed(found), key=lambda event: rank.get(event.kind, len(rank)), default=None)


def assess(frames: Frames, *, start: Pose, begin_s: float, end_s: float, rate_hz: float) -> Quality:
    """Return the quality of a run from `begin_s` to `end_s` that was to start at `start` (floor frame).

    The tracked share counts distinct camera frames with a pose against the frames that a camera of `rate_hz`
    takes in that time, so that lost frames count like untracked ones.
    """
    times = np.unique(frames.t_s[frames.tracked & (frames.t_s >= begin_s) & (frames.t_s <= end_s)])
    expected = max(1.0, (end_s - begin_s) * rate_hz)
    edges = np.concatenate([[begin_s], times, [end_s]])
    found = pose_before(frames, 0.0)
    return Quality(
        tracked_share=min(1.0, len(times) / expected),
        longest_gap_s=float(np.max(np.diff(edges))),
        start_position_error_m=math.dist(found[:2], start[:2]) if found else math.nan,
        start_heading_error_rad=abs(wrap_angle(found.heading_rad - start.heading_rad)) if found else math.nan,
        rests_before=is_at_rest(frames, until_s=0.0),
        rests_after=is_at_rest(frames, until_s=end_s),
    )
