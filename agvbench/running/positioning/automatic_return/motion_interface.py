"""Motion interface of a return: commands out under supervision, pose and speed estimated from frames."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from agvbench.running.links import RunnerLink
from agvbench.running.supervision.supervisor import Supervisor
from agvbench.types import Command, Floats, Frames, Pose, wrap_angle

_WINDOW_S = 0.1
_FEWEST_FRAMES = 3
_SMOOTHING = 0.6
_FARTHEST_S = 0.5
"""A pose is extrapolated no further than this."""


@dataclass(frozen=True)
class Step:
    """What a vehicle did between two looks: how far it went ahead and to its left [m], how far it turned [rad]."""

    forward_m: float
    left_m: float
    turn_rad: float


class PoseEstimator:
    """Medians of the last tenth of a second, carried on to the present at the speed seen.

    Single wrong frames, metres off, move no median; while a camera says nothing, its last pose is carried on.
    """

    def __init__(self) -> None:
        self._recent = Frames.empty()
        self._median: tuple[float, Floats] | None = None
        self._velocity = np.zeros(3)
        self._now_s = 0.0
        self.speed_mps = 0.0

    def update(self, frames: Frames, now_s: float) -> Step | None:
        """Take in `frames`, the time being `now_s` [s]; return the step since the last look.

        None if too little was seen.
        """
        self._recent = _latest(Frames.concatenate([self._recent, frames.select(frames.tracked)]))
        self._now_s = now_s
        if len(self._recent) < _FEWEST_FRAMES:
            return None
        before, self._median = self._median, _median(self._recent)
        if before is None or self._median[0] - before[0] < 0.25 * _WINDOW_S:
            self._median = self._median if before is None else before
            return None
        return self._moved(before, self._median)

    def _moved(self, before: tuple[float, Floats], after: tuple[float, Floats]) -> Step:
        moved = after[1] - before[1]
        moved[2] = wrap_angle(moved[2])
        since_s = after[0] - before[0]
        self._velocity += _SMOOTHING * (moved / since_s - self._velocity)
        middle = before[1][2] + 0.5 * moved[2]
        ahead, left = math.cos(middle), math.sin(middle)
        dx, dy, turn = moved.tolist()
        step = Step(ahead * dx + left * dy, ahead * dy - left * dx, turn)
        self.speed_mps += _SMOOTHING * (step.forward_m / since_s - self.speed_mps)
        return step

    @property
    def pose(self) -> Pose | None:
        """The pose now (floor frame), None before anything was seen."""
        if self._median is None:
            return None
        since_s = min(_FARTHEST_S, self._now_s - self._median[0])
        x_m, y_m, heading_rad = self._median[1] + self._velocity * since_s
        return Pose(float(x_m), float(y_m), float(heading_rad))


def _latest(frames: Frames) -> Frames:
    """Return the frames of the last tenth of a second that was seen, maybe a while ago; of a slow camera, three."""
    order = np.argsort(frames.t_s, kind="stable")
    since_s = frames.t_s[order[-1]] - _WINDOW_S if len(order) else 0.0
    count = max(_FEWEST_FRAMES, int((frames.t_s > since_s).sum()))
    return frames.select(order[-count:])


def _median(frames: Frames) -> tuple[float, Floats]:
    reference = float(frames.heading_rad[-1])
    turned = np.median(np.angle(np.exp(1j * (frames.heading_rad - reference))))
    pose = np.array([np.median(frames.x_m), np.median(frames.y_m), reference + turned])
    return float(np.median(frames.t_s)), pose


class MotionInterface:
    """Holds commands one after another on the clock of a return, which begins at 0."""

    def __init__(self, link: RunnerLink, supervisor: Supervisor) -> None:
        self._link, self._supervisor = link, supervisor
        self.where = link.keys.root
        self.pose_estimator, self.now_s = PoseEstimator(), 0.0
        self.step: Step | None = None

    def begin(self) -> None:
        """Let the supervisor begin anew: the vehicle stands."""
        self._supervisor.begin()

    def hold(self, command: Command, hold_s: float) -> Frames:
        """Hold `command` for `hold_s` [s]; return the frames that arrived; ``pose_estimator`` and ``step`` follow them.

        Raises
        ------
        SafetyStopError
            If the supervisor stopped the vehicle.
        LinkError
            As from the link.
        """
        seen: list[Frames] = []
        self._supervisor.control_cycle(self._link, command, t_s=self.now_s, hold_s=hold_s, seen=seen)
        self.now_s += hold_s
        frames = Frames.concatenate(seen)
        self.step = self.pose_estimator.update(frames, self.now_s)
        return frames
