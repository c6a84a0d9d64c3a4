"""Clock offsets of sessions: by how much later the poses of one session answer its commands than those of the others.

The clocks of camera and vehicle are seldom one clock, and their offset may differ between recordings. What all sessions
have in common, a delay or a lag, belongs to the effects; only differences are estimated here. The turn between two
frames is regressed on the steering commands between them, delayed by each of many offsets, with one steering map and
one lag for all sessions. Without the lag, slow and fast steering would seem to have different delays. Without the
average over the time between the frames, any rate of frames would seem to be a lag.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit  # not scipy.stats, which takes half a second to import

from agvbench.calibration.measurement.windows import held_command
from agvbench.diagnosis.criteria import SESSION_CLOCK
from agvbench.diagnosis.data.differing_sessions import differing_sessions, others
from agvbench.diagnosis.data.windows import unwrapped_track
from agvbench.signals import robust_std
from agvbench.types import Commands, Floats, Run

_OFFSETS_S = np.arange(-0.4, 1.0, 0.02)
_LAGS_S = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6)
# Least time from the start of one interval to that of the next, and at most so many in a session: for the offsets, and
# for the lag that all sessions have in common.
_STEP_S, _MOST_ROWS, _ROWS_FOR_LAG = 0.04, 10_000, 500
_NODES = 13
_BLOCK_S = 2.0
# Of a slope of the loss, in offsets to either side.
_REACH = 3
_ROUNDS, _REWEIGHTINGS = 12, 3
# Intervals last so long at least, and at most; within them commands are averaged over so many instants.
_SHORTEST_S, _LONGEST_S = 0.4, 0.7
_INSTANTS = (np.arange(4) + 0.5) / 4.0
_OUTLIER = 3.0
_MIN_ROWS = 100


@dataclass(frozen=True)
class ClockOffset:
    """The offset of a session's poses against its commands, less that of the other sessions: [s], with its error.

    A positive one is a clock of the camera behind that of the others. The commands of a ``significant`` one were moved.
    """

    value_s: float
    stderr_s: float
    significant: bool


@dataclass(frozen=True)
class _Rows:
    """The mean yaw rate ``turned`` (n,) of a session's intervals, the mean ``speed``, and the block of each.

    ``commanded`` (offsets, axles, instants, n) are the commands of the axles that steer, delayed by each offset. The
    speed of a vehicle that is commanded a yaw rate is one.
    """

    turned: Floats
    speed: Floats
    block: Floats
    commanded: Floats


def clock_offsets(
    runs: Sequence[Run], *, is_differential: bool, partial: Collection[str] = ()
) -> dict[str, ClockOffset]:
    """Return the clock offset of each session that is long enough; empty with fewer than two of them.

    Of the sessions in `partial`, which are set apart for the test, only the first seconds are used.
    """
    sessions: dict[str, list[Run]] = {}
    used = [run for run in runs if run.is_ok and len(run.commands)]
    for run in used:
        sessions.setdefault(run.session or "", []).append(run)
    steered = [role for role in ("front", "rear") if any(np.ptp(getattr(run.commands, role)) for run in used)]
    if not steered:
        return {}
    tracks = {
        name: [_track(run, min(r.started_s for r in own), is_differential=is_differential) for run in own]
        for name, own in sessions.items()
    }
    tracks = {
        name: [one.until(SESSION_CLOCK.adapted_s) for one in own] if name in partial else own
        for name, own in tracks.items()
    }
    tracks = {name: own for name, own in tracks.items() if sum(len(one.begin_s) for one in own) >= _MIN_ROWS}
    if len(tracks) < 2:
        return {}

    def fitted(lag_s: float, most: int) -> tuple[list[Floats], float]:
        return _block_losses([_rows(own, steered, lag_s, most) for own in tracks.values()])

    losses, _ = fitted(min(_LAGS_S, key=lambda lag_s: fitted(lag_s, _ROWS_FOR_LAG)[1]), _MOST_ROWS)
    estimates = {name: _estimate(loss) for name, loss in zip(tracks, losses, strict=True)}
    known = {name: one for name, one in estimates.items() if one.stderr_s <= SESSION_CLOCK.max_stderr_s}
    return _differences(known)


def aligned(runs: Iterable[Run], offsets: Mapping[str, ClockOffset]) -> list[Run]:
    """Return `runs` with the commands of sessions whose offset is significant moved to the clock of the others."""
    out = []
    for run in runs:
        offset = offsets.get(run.session or "")
        if offset is not None and offset.significant:
            run = replace(run, commands=replace(run.commands, t_s=run.commands.t_s + offset.value_s))  # noqa: PLW2901
        out.append(run)
    return out


@dataclass(frozen=True)
class _Track:
    """A run's motion in intervals between frames that begin at ``begin_s`` (n,) and last ``length_s``.

    ``speed`` and ``yaw_rate`` are means, ``elapsed_s`` seconds since the session began.
    """

    commands: Commands
    begin_s: Floats
    length_s: Floats
    speed: Floats
    yaw_rate: Floats
    elapsed_s: Floats

    def select(self, kept: NDArray[np.bool_]) -> _Track:
        parts = (part[kept] for part in (self.begin_s, self.length_s, self.speed, self.yaw_rate, self.elapsed_s))
        return _Track(self.commands, *parts)

    def until(self, seconds: float) -> _Track:
        """Return the part in the first `seconds` of the session."""
        return self.select(self.elapsed_s <= seconds)


def _track(run: Run, began_s: float, *, is_differential: bool) -> _Track:
    t_s, poses = unwrapped_track(run)
    first, last = _intervals(t_s, float(run.commands.t_s[0] + _OFFSETS_S[-1]))
    length_s = t_s[last] - t_s[first]
    moved = (poses[last] - poses[first]) / length_s[:, None]
    heading = 0.5 * (poses[first, 2] + poses[last, 2])
    forward = np.cos(heading) * moved[:, 0] + np.sin(heading) * moved[:, 1]
    speed = np.ones(len(first)) if is_differential else forward
    track = _Track(
        run.commands.without_repeats(), t_s[first], length_s, speed, moved[:, 2], run.started_s - began_s + t_s[first]
    )
    return track.select(np.abs(speed) > SESSION_CLOCK.min_speed_mps)


def _intervals(t_s: Floats, from_s: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first and last frames of intervals of frames at `t_s` (k,) that begin at `from_s` or later."""
    steps = np.floor(t_s / _STEP_S)
    first = np.flatnonzero((t_s >= from_s) & np.r_[True, np.diff(steps) > 0.0][: len(t_s)])
    last = np.searchsorted(t_s, t_s[first] + _SHORTEST_S - 1e-6)
    first, last = first[last < len(t_s)], last[last < len(t_s)]
    near = t_s[last] - t_s[first] <= _LONGEST_S
    return first[near], last[near]


def _rows(tracks: Sequence[_Track], steered: Sequence[str], lag_s: float, most: int) -> _Rows:
    every = 1 + sum(len(one.begin_s) for one in tracks) // most
    tracks = [one.select(np.arange(len(one.begin_s)) % every == 0) for one in tracks]
    commanded = []
    for one in tracks:
        instants_s = one.begin_s + _INSTANTS[:, None] * one.length_s - _OFFSETS_S[:, None, None]
        commanded.append(np.stack([_lagged(one.commands, role, instants_s, lag_s) for role in steered], axis=1))
    turned, speed, elapsed_s = (
        np.concatenate([getattr(one, name) for one in tracks]) for name in ("yaw_rate", "speed", "elapsed_s")
    )
    return _Rows(turned, speed, np.floor(elapsed_s / _BLOCK_S), np.concatenate(commanded, axis=-1))


def _lagged(commands: Commands, role: str, t_s: Floats, lag_s: float) -> Floats:
    """Return the commands of `role` at `t_s`, behind a lag of first order; the first one was given long before."""
    if lag_s == 0.0:
        return held_command(commands, role, t_s)
    values: Floats = getattr(commands, role)
    index = np.maximum(np.searchsorted(commands.t_s, t_s + 1e-9, side="right") - 1, 0)
    state, left = np.empty(len(values)), np.exp(-np.diff(commands.t_s) / lag_s)
    state[0] = values[0]
    for k, share in enumerate(left):
        state[k + 1] = values[k] + (state[k] - values[k]) * share
    since_s = np.maximum(t_s - commands.t_s[index], 0.0)
    return np.asarray(values[index] + (state[index] - values[index]) * np.exp(-since_s / lag_s))


def _block_losses(rows: list[_Rows]) -> tuple[list[Floats], float]:
    """Return the loss of each block at each offset (blocks, offsets) by session, and the scale of the residuals.

    All sessions have one map.
    """
    ends = np.concatenate([one.commanded for one in rows], axis=-1)
    nodes = np.linspace(ends.min(axis=(0, 2, 3)), ends.max(axis=(0, 2, 3)), _NODES, axis=-1)
    best = [int(np.argmin(np.abs(_OFFSETS_S - 0.1)))] * len(rows)
    losses, scale = list[Floats](), np.inf
    for _ in range(_ROUNDS):
        curve, scale = _map(rows, best, nodes)
        losses = [_losses(one, nodes, curve, scale) for one in rows]
        moved = [int(np.argmin(loss.sum(axis=0))) for loss in losses]
        if moved == best:
            break
        best = moved
    return losses, scale


def _map(rows: list[_Rows], offsets: list[int], nodes: Floats) -> tuple[Floats, float]:
    """Return the values of the steering map at its nodes, robustly fitted at these offsets, and their scale."""
    design = np.concatenate([_design(one, one.commanded[k], nodes) for one, k in zip(rows, offsets, strict=True)])
    turned = np.concatenate([one.turned for one in rows])
    weight = np.ones(len(turned))
    curve, scale = np.zeros(design.shape[1]), 1.0
    for _ in range(_REWEIGHTINGS):
        # The maps of two axles are known up to a constant: a small ridge decides.
        normal = design.T @ (design * weight[:, None]) + 1e-6 * len(turned) * np.eye(design.shape[1])
        curve = np.linalg.solve(normal, design.T @ (weight * turned))
        residual = turned - design @ curve
        scale = max(robust_std(residual), 1e-6)
        weight = 1.0 / (1.0 + (residual / (_OUTLIER * scale)) ** 2)
    return curve, scale


def _losses(rows: _Rows, nodes: Floats, curve: Floats, scale: float) -> Floats:
    blocks, index = np.unique(rows.block, return_inverse=True)
    out = np.empty((len(blocks), len(_OFFSETS_S)))
    for k, delayed in enumerate(rows.commanded):
        curvature = sum(
            np.interp(command, own, values).mean(axis=0)
            for command, own, values in zip(delayed, nodes, curve.reshape(len(nodes), -1), strict=True)
        )
        residual = (rows.turned - rows.speed * curvature) / scale
        out[:, k] = np.bincount(index, np.log1p((residual / _OUTLIER) ** 2), len(blocks))
    return out


def _design(rows: _Rows, commanded: Floats, nodes: Floats) -> Floats:
    """Return the derivatives of the yaw rate (n, axles · nodes) by the nodal values, at one of `commanded`."""
    weights = [
        np.interp(command, own, unit).mean(axis=0)
        for command, own in zip(commanded, nodes, strict=True)
        for unit in np.eye(_NODES)
    ]
    return np.asarray(rows.speed[:, None] * np.stack(weights, axis=-1))


@dataclass(frozen=True)
class _Estimate:
    value_s: float
    stderr_s: float
    blocks: int


def _estimate(losses: Floats) -> _Estimate:
    """Return the offset with the least loss, and its standard error.

    The error is that of an M-estimator, clustered by block (sandwich estimator, Liang and Zeger 1986): the slope of
    each block's loss over the bend of the total. Both are differences over a few offsets, because a command acts on the
    loss in steps.
    """
    total, count = losses.sum(axis=0), len(losses)
    k = int(np.clip(np.argmin(total), _REACH, len(total) - 1 - _REACH))
    if count < SESSION_CLOCK.min_blocks:
        return _Estimate(_minimum(total), np.inf, count)
    reach_s = _REACH * (_OFFSETS_S[1] - _OFFSETS_S[0])
    slope = (losses[:, k + _REACH] - losses[:, k - _REACH]) / (2.0 * reach_s)
    bend = (total[k + _REACH] - 2.0 * total[k] + total[k - _REACH]) / reach_s**2
    scatter = float(np.sqrt(count / (count - 1.0) * np.sum((slope - slope.mean()) ** 2)))
    stderr = float(scatter / bend) if bend > 0.0 else np.inf
    return _Estimate(_minimum(total), max(stderr, SESSION_CLOCK.least_stderr_s), count)


def _minimum(loss: Floats) -> float:
    """Return the offset of the least loss, between the grid by a parabola."""
    k = int(np.clip(np.argmin(loss), 1, len(loss) - 2))
    before, here, after = loss[k - 1 : k + 2]
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return float(_OFFSETS_S[k] + np.clip(shift, -1.0, 1.0) * (_OFFSETS_S[1] - _OFFSETS_S[0]))


def _differences(estimates: dict[str, _Estimate]) -> dict[str, ClockOffset]:
    """Return the offset of each session from the common one: the weighted mean of the sessions that do not differ."""

    def deviation(one: _Estimate, rest: list[_Estimate]) -> float | None:
        value, stderr = _against(one, rest)
        return abs(value) / stderr if _is_significant(value, stderr, one.blocks, len(estimates)) else None

    differing = differing_sessions(estimates, deviation, lambda one: one.blocks)
    common = {name: one for name, one in estimates.items() if name not in differing}
    return {
        name: ClockOffset(*_against(one, others(common, name)), significant=name in differing)
        for name, one in estimates.items()
    }


def _against(one: _Estimate, rest: list[_Estimate]) -> tuple[float, float]:
    """Return the difference of an estimate from the weighted mean of others, with its standard error."""
    if not rest:
        return 0.0, one.stderr_s
    weight = np.array([1.0 / other.stderr_s**2 for other in rest])
    values = np.array([other.value_s for other in rest])
    middle = float(np.sum(weight * values) / np.sum(weight))
    spread = float(np.std(values)) if len(values) > 2 else 0.0
    return one.value_s - middle, float(np.sqrt(one.stderr_s**2 + 1.0 / np.sum(weight) + spread**2))


def _is_significant(value: float, stderr: float, blocks: int, sessions: int) -> bool:
    critical = -float(stdtrit(max(blocks - 1, 1), 0.5 * SESSION_CLOCK.alpha / sessions))
    return abs(value) > max(SESSION_CLOCK.min_offset_s, critical * stderr)
