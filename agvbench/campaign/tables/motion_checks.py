"""Motion checks: whether poses are in metres and radians, and whether their time runs forward.

No model is needed: vehicles have a largest speed, they drive towards their targets, their heading changes with their
direction of travel, and they answer commands instead of preceding them. Slip, crabbing, tracker jumps and rest are
motions of real vehicles, so each rule compares the units as declared with one other reading of the same numbers, and
says nothing unless the other reading describes the motion far better. Only runs with status "ok" are judged.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from agvbench.campaign.header import CampaignHeader
from agvbench.campaign.tables.timed_table import TimedTable
from agvbench.errors import CampaignError
from agvbench.types import RUN_OK, Floats, wrap_angle

_MOST_RUNS = 100
_STEP_S = 0.2
_FEWEST_STEPS = 5
_FASTEST_MPS, _FASTEST_WHEELBASES = 20.0, 100.0
_USUAL, _MOVES = 0.75, 0.3
_LEAST_TARGET_M, _FARTHEST_TIMES = 0.1, 30.0
_LEAST_SPREAD, _HALF, _SOME = 0.02, 0.5, 0.25
_FEWEST, _TIMES = 3, 4
_FEWEST_COMMANDS, _LONG_STEPS, _CORRELATED = 3, 15, 0.7
_LAGS_S = np.arange(-0.2, 1.05, 0.1)

Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class _Steps:
    """Motion from one sampled pose to the next, 0.2 s later; every array but `runs` has shape (steps,).

    ``run`` is an index into `runs`, which holds the numbers of the judged runs; ``start`` and ``end`` are poses (m, m,
    rad as declared), ``t_s`` the time halfway.
    """

    runs: Indices
    run: Indices
    t_s: Floats
    seconds: Floats
    start: Floats
    end: Floats

    @property
    def speed(self) -> Floats:
        """[m/s]."""
        return np.asarray(np.hypot(*(self.end - self.start).T[:2]) / self.seconds)

    @property
    def course(self) -> Floats:
        """Direction of travel [rad]."""
        along, across, _ = (self.end - self.start).T
        return np.asarray(np.arctan2(across, along))

    def heading(self, unit_rad: float = 1.0) -> Floats:
        """Return the heading halfway [rad], its numbers read as so many radians each."""
        first = unit_rad * self.start[:, 2]
        return np.asarray(first + 0.5 * wrap_angle(unit_rad * self.end[:, 2] - first))

    def turned(self, unit_rad: float = 1.0) -> Floats:
        """Return the change of heading [rad], its numbers read as so many radians each."""
        return wrap_angle(unit_rad * (self.end[:, 2] - self.start[:, 2]))

    def sums(self, values: Floats) -> Floats:
        """Return the sum over each judged run, shape (runs,)."""
        return np.bincount(self.run, values, len(self.runs)).astype(np.float64)

    @property
    def counts(self) -> Indices:
        """Steps of each judged run."""
        return np.bincount(self.run, minlength=len(self.runs))

    def ends(self) -> tuple[Indices, Indices]:
        """Return the first and the last step of each judged run; any step for a run without steps."""
        runs = np.arange(len(self.runs))
        first, last = np.searchsorted(self.run, runs), np.searchsorted(self.run, runs, side="right") - 1
        return np.minimum(first, len(self.run) - 1), np.maximum(last, 0)

    def select(self, keep: Mask) -> _Steps:
        """Return some of the steps."""
        kept = self.run[keep], self.t_s[keep], self.seconds[keep], self.start[keep], self.end[keep]
        return _Steps(self.runs, *kept)


def check_motion(header: CampaignHeader, runs: pa.Table, commands: TimedTable, poses: TimedTable) -> None:
    """Check that the poses move as vehicles do; with too little motion to judge, say nothing.

    At most 100 runs are judged, evenly spread over the campaign. Rows of `runs` are in the order of the tables' runs.

    Raises
    ------
    CampaignError
        If positions are not in metres, headings not in radians, or the time of the poses runs backward.
    """
    ok = np.flatnonzero(np.equal(runs["status"].to_pylist(), RUN_OK))
    judged = ok[np.unique(np.linspace(0, len(ok) - 1, min(len(ok), _MOST_RUNS)).astype(np.int64))]
    steps = _steps(poses, judged)
    if not len(steps.run):
        return
    usual = _usual_speed(steps)
    _check_speed(steps, usual, header, poses)
    moving = steps.select(steps.speed > _MOVES * usual[steps.run])
    _check_heading(moving, poses)
    _check_targets(steps, runs, poses)
    _check_time(steps, header, commands, poses)


def _steps(poses: TimedTable, judged: Indices) -> _Steps:
    """Return the steps of the judged runs: the first tracked pose of each 0.2 s to that of the next."""
    rows = np.concatenate([np.arange(*poses.offsets[[run, run + 1]]) for run in judged] or [np.zeros(0, np.int64)])
    rows = rows[poses.column("tracked")[rows].astype(bool)]
    if np.any((np.diff(poses.column("t_s")[rows]) < 0.0) & (np.diff(poses.run_of_row[rows]) == 0)):
        rows = rows[np.lexsort((poses.column("t_s")[rows], poses.run_of_row[rows]))]
    run, t_s = np.searchsorted(judged, poses.run_of_row[rows]), poses.column("t_s")[rows]
    first = np.flatnonzero(np.r_[True, (np.diff(np.floor(t_s / _STEP_S)) != 0.0) | (np.diff(run) != 0)][: len(rows)])
    run, t_s, rows = run[first], t_s[first], rows[first]
    pose = np.column_stack([poses.column(name)[rows] for name in ("x_m", "y_m", "heading_rad")])
    seconds = np.diff(t_s)
    # Gaps in tracking make steps of another length.
    sound = (np.diff(run) == 0) & (seconds > 0.5 * _STEP_S) & (seconds < 2.0 * _STEP_S)
    at = np.flatnonzero(sound)
    return _Steps(judged, run[at], 0.5 * (t_s[at] + t_s[at + 1]), seconds[at], pose[at], pose[at + 1])


def _usual_speed(steps: _Steps) -> Floats:
    """Return the speed [m/s] that each run reaches for a quarter of its time; 0 for a run without steps."""
    order = np.lexsort((steps.speed, steps.run))
    counts = steps.counts
    offsets = np.cumsum(counts) - counts
    usual = np.zeros(len(steps.runs))
    has = counts > 0
    usual[has] = steps.speed[order][(offsets + (_USUAL * (counts - 1)).astype(np.int64))[has]]
    return usual


def _check_speed(steps: _Steps, usual: Floats, header: CampaignHeader, poses: TimedTable) -> None:
    wheelbase_m = header.front_axle_m + header.rear_axle_m
    has_wheelbase = header.kinematics == "two_axle"
    limit = min(_FASTEST_MPS, _FASTEST_WHEELBASES * wheelbase_m) if has_wheelbase else _FASTEST_MPS
    enough = steps.counts >= _FEWEST_STEPS
    fast: Mask = enough & (usual > limit)
    if np.count_nonzero(fast) > _SOME * np.count_nonzero(enough):
        raise CampaignError(
            "x_m and y_m are not in metres",
            where=_where(poses, steps, fast),
            value=f"vehicle drives at {usual[fast][0]:.3g} m/s{_as_in(fast, enough)}",
            limit=f"{limit:.3g} m/s" + (f", for a wheelbase of {wheelbase_m:.3g} m" if has_wheelbase else ""),
            remedy="convert them to metres",
        )


def _check_heading(moving: _Steps, poses: TimedTable) -> None:
    """Compare how well the heading, in radians and in degrees, follows the direction of travel of runs that turn."""
    course = moving.course
    none = _spread(moving, course)
    radians = _spread(moving, course - moving.heading())
    degrees = _spread(moving, course - moving.heading(math.radians(1.0)))
    turns: Mask = (moving.counts >= _FEWEST_STEPS) & (none > _LEAST_SPREAD)
    wrong: Mask = turns & (degrees < _HALF * none) & (degrees < _HALF * radians)
    if 2 * np.count_nonzero(wrong) > np.count_nonzero(turns):
        run = int(np.argmax(wrong))
        path = 0.5 * wrap_angle(2.0 * np.diff(course[moving.run == run])).sum()  # the same driven backward
        turned = np.degrees(moving.turned(math.radians(1.0))[moving.run == run].sum())
        raise CampaignError(
            "heading_rad is not in radians",
            where=_where(poses, moving, wrong),
            value=f"it changes by {turned:.3g} where the direction of travel changes by {path:.3g} rad"
            f"{_as_in(wrong, turns)}",
            limit="the same change",
            remedy="convert it from degrees to radians",
        )


def _spread(steps: _Steps, angle_rad: Floats) -> Floats:
    """Return the circular variance of a line's direction in each run: 0 if it never changes, 1 if it is uniform."""
    double = 2.0 * angle_rad
    length = np.hypot(steps.sums(np.cos(double)), steps.sums(np.sin(double)))
    return np.asarray(1.0 - length / np.maximum(steps.counts, 1))


def _check_targets(steps: _Steps, runs: pa.Table, poses: TimedTable) -> None:
    """Compare where runs with a target ended, as seen from their start, with the target."""
    target = np.column_stack([runs[name].to_numpy()[steps.runs] for name in ("target_x_m", "target_y_m")])
    distance = np.hypot(*target.T)
    aimed: Mask = (distance > _LEAST_TARGET_M) & (steps.counts >= _FEWEST_STEPS)  # false where there is no target
    reached, along = _reached(steps, target / np.where(aimed, distance, 1.0)[:, None])
    far: Mask = aimed & (reached > _FARTHEST_TIMES * distance)
    if np.count_nonzero(far) > _SOME * np.count_nonzero(aimed):
        raise CampaignError(
            "x_m and y_m are not in metres",
            where=_where(poses, steps, far),
            value=f"it ends {reached[far][0]:.4g} m from its start{_as_in(far, aimed)}",
            limit=f"its target is {distance[far][0]:.3g} m away",
            remedy="convert them to metres",
        )
    went = aimed & (reached > _HALF * distance)
    away, towards = went & (along < -_HALF * reached), went & (along > _HALF * reached)
    if _outweighs(away, towards):
        raise CampaignError(
            "poses run backward in time, heading_rad is turned by 180°, or the drive runs the other way",
            where=_where(poses, steps, away),
            value=f"it ends {-along[away][0]:.3g} m in the direction opposite to its target{_as_in(away, aimed)}",
            limit=f"its target is {distance[away][0]:.3g} m away",
            remedy="let t_s grow with time, measure the heading along the vehicle's forward axis, or exchange "
            "output_low and output_high of the drive in vehicle.toml and drive again",
        )


def _reached(steps: _Steps, direction: Floats) -> tuple[Floats, Floats]:
    """Return each run's distance from start to end [m], and along `direction` (runs, 2) as seen from its start [m]."""
    first, last = steps.ends()
    x_m, y_m, _ = (steps.end[last] - steps.start[first]).T
    cos, sin = np.cos(steps.start[first, 2]), np.sin(steps.start[first, 2])
    ahead, left = cos * x_m + sin * y_m, cos * y_m - sin * x_m
    return np.asarray(np.hypot(x_m, y_m)), np.asarray(ahead * direction[:, 0] + left * direction[:, 1])


def _check_time(steps: _Steps, header: CampaignHeader, commands: TimedTable, poses: TimedTable) -> None:
    """Compare how well speed and yaw rate follow varied commands as time is given, and as it is reversed."""
    varied: Mask = (steps.counts >= _LONG_STEPS) & (commands.counts[steps.runs] >= _FEWEST_COMMANDS)
    if not varied.any():
        return
    steps = steps.select(varied[steps.run])
    first, last = steps.ends()
    given = _follows(steps, steps.t_s, header, commands)
    reverse = _follows(steps, (steps.t_s[first] + steps.t_s[last])[steps.run] - steps.t_s, header, commands)
    forward: Mask = np.any(_far_better(given, reverse), axis=0)
    backward: Mask = np.any(_far_better(reverse, given), axis=0)
    if _outweighs(backward, forward):
        run = int(np.argmax(backward))
        channel = int(np.argmax(reverse[:, run] - given[:, run]))
        raise CampaignError(
            "poses run backward in time",
            where=_where(poses, steps, backward),
            value=f"its {('speed', 'yaw rate')[channel]} follows the commands with correlation "
            f"{given[channel, run]:.2f}, and with {reverse[channel, run]:.2f} if t_s is reversed"
            f"{_as_in(backward, varied)}",
            remedy="let t_s grow with time",
        )


def _outweighs(one: Mask, other: Mask) -> bool:
    return int(np.count_nonzero(one)) >= max(_FEWEST, _TIMES * int(np.count_nonzero(other)))


def _far_better(one: Floats, other: Floats) -> Mask:
    return np.asarray((one > _CORRELATED) & (1.0 - one**2 < _HALF * (1.0 - other**2)))


def _follows(steps: _Steps, t_s: Floats, header: CampaignHeader, commands: TimedTable) -> Floats:
    """Return how speed and yaw rate correlate with their commands at the best delay, shape (2, runs), each 0…1."""
    along = steps.end - steps.start
    heading = steps.heading()
    ahead = (np.cos(heading) * along[:, 0] + np.sin(heading) * along[:, 1]) / steps.seconds
    yaw_rate = steps.turned() / steps.seconds
    best = np.zeros((2, len(steps.runs)))
    for lag_s in _LAGS_S:
        row = _command_rows(commands, steps.runs[steps.run], t_s - lag_s)
        drive = np.abs(commands.column("drive")[row] - header.neutral.drive)
        steering = commands.column("front")[row] - commands.column("rear")[row]
        follow = np.maximum(_correlation(steps, np.abs(ahead), drive), 0.0)
        # Steering commands an angle of an axle, or the yaw rate itself.
        turn = [np.abs(_correlation(steps, yaw_rate, by)) for by in (ahead * steering, steering)]
        best = np.maximum(best, [follow, np.maximum(*turn)])
    return best


def _command_rows(commands: TimedTable, run: Indices, t_s: Floats) -> Indices:
    """Return the row of the command that holds in each run at each time; the first before its time."""
    span = 2.0 * float(np.abs(commands.column("t_s")).max() + np.abs(t_s).max()) + 1.0
    key = commands.run_of_row * span + commands.column("t_s")
    row = np.searchsorted(key, run * span + t_s, side="right") - 1
    return np.asarray(np.maximum(row, commands.offsets[run]))


def _correlation(steps: _Steps, one: Floats, other: Floats) -> Floats:
    """Return Pearson's correlation within each run; 0 where one of the two does not vary."""
    count = np.maximum(steps.counts, 1)
    one = one - (steps.sums(one) / count)[steps.run]
    other = other - (steps.sums(other) / count)[steps.run]
    scale = np.sqrt(steps.sums(one * one) * steps.sums(other * other))
    return np.asarray(steps.sums(one * other) / np.where(scale > 1e-12, scale, np.inf))


def _where(poses: TimedTable, steps: _Steps, runs: Mask) -> str:
    return f"{poses.path}: run {poses.run_ids[int(steps.runs[int(np.argmax(runs))])]}"


def _as_in(runs: Mask, judged: Mask) -> str:
    return f", as in {np.count_nonzero(runs)} of {np.count_nonzero(judged)} runs judged"
