"""Repeats of one trajectory under one condition by their rest poses, as arrays that budgets are computed from."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from agvbench.errors import FitError
from agvbench.statistics.rest_poses import RestPose, end_pose, start_pose
from agvbench.types import Floats, Pose, Run, wrap_angle

At = Literal["start", "end"]


@dataclass(frozen=True)
class RestPoses:
    """One run by its rest poses (floor frame), its target (start frame), the delay of its frames and its session.

    ``key`` is trajectory and condition; ``delay_s`` is the longest time from capture to receipt, NaN if not recorded.
    """

    key: tuple[str, str]
    target: Pose
    start: RestPose
    end: RestPose
    delay_s: float = math.nan
    session: str = ""


def rest_poses(run: Run) -> Iterator[RestPoses]:
    """Yield the rest poses of `run`; nothing if it has none."""
    try:
        start, end = start_pose(run), end_pose(run)
    except FitError:
        return
    delays = run.frames.received_s - run.frames.t_s
    delay_s = float(np.max(delays, where=np.isfinite(delays), initial=-math.inf))
    known_s = delay_s if math.isfinite(delay_s) else math.nan
    yield RestPoses((run.trajectory, run.condition), run.target, start, end, known_s, run.session or "")


class Repeats:
    """Repeats in the start frame.

    ``reached`` and ``error`` have shape (n, 2) [mm], ``turned`` (n,) [rad] is the rotation made, and ``heading`` (n,)
    [deg] the heading error.
    """

    def __init__(self, runs: Sequence[RestPoses]) -> None:
        self.runs = runs
        ends = [one.end.pose.relative_to(one.start.pose) for one in runs]
        targets = [one.target for one in runs]
        self.reached = 1e3 * np.array([end[:2] for end in ends])
        self.error = self.reached - 1e3 * np.array([target[:2] for target in targets])
        self.turned = np.array([end.heading_rad for end in ends])
        turned = [wrap_angle(end.heading_rad - to.heading_rad) for end, to in zip(ends, targets, strict=True)]
        self.heading = np.degrees(turned)

    def __len__(self) -> int:
        """Return how many repeats there are."""
        return len(self.runs)

    @cached_property
    def distance(self) -> Floats:
        """The end position errors, shape (n,) [mm]."""
        return np.asarray(np.hypot(*self.error.T))

    @property
    def across_path(self) -> Floats:
        """Change of the end position error per rotation of the start frame, shape (n,) [mm/rad]."""
        outward = self.error / np.where(self.distance > 0.0, self.distance, 1.0)[:, np.newaxis]
        return np.asarray(outward[:, 0] * self.reached[:, 1] - outward[:, 1] * self.reached[:, 0])

    @property
    def sessions(self) -> list[str]:
        """The distinct sessions."""
        return list(dict.fromkeys(one.session for one in self.runs))

    def of_session(self, session: str) -> Floats:
        """Return the indices of the repeats of `session`."""
        return np.array([k for k, one in enumerate(self.runs) if one.session == session])

    def column(self, at: At, name: str) -> Floats:
        """Return an attribute of the rest poses at ``start`` or ``end``, shape (n,)."""
        return np.array([getattr(getattr(one, at), name) for one in self.runs], dtype=float)

    def frames(self, at: At) -> float:
        """Return the pooled degrees of freedom of the rest poses at ``start`` or ``end``."""
        return float(max(1, sum(getattr(one, at).frames - 1 for one in self.runs)))

    @property
    def delay_ms(self) -> float:
        """The longest delay between capture and receipt [ms]; NaN if not recorded."""
        delays = [one.delay_s for one in self.runs if math.isfinite(one.delay_s)]
        return 1e3 * max(delays, default=math.nan)

    def at_rest(self, name: str) -> float:
        """Return the root mean square of a velocity at both rest poses together; what noise makes of it is in it.

        NaN where no run has a start, or no run has an end, from whose frames it can be computed.
        """
        return math.hypot(mean_square_root(self.column("start", name)), mean_square_root(self.column("end", name)))

    @property
    def noise_mm2(self) -> float:
        """Variance that noise of the camera adds to end positions, the sum of both axes [mm²]; NaN if not known."""
        positions = [2.0 * mean_square_root(1e3 * self.column(at, "stderr_position_m")) ** 2 for at in ("start", "end")]
        turning = mean_square_root(self.column("start", "stderr_heading_rad") * np.hypot(*self.reached.T))
        return float(sum(positions) + turning**2)


def mean_square_root(values: Floats) -> float:
    """Return the root of the mean square of those values (n,) that are finite; NaN if none is."""
    known = values[np.isfinite(values)]
    return math.sqrt(float(np.mean(known**2))) if len(known) else math.nan
