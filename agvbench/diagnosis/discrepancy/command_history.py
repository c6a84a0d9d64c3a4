"""What each axle was commanded before, at each residual rate: regressors of terms that depend on history."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from agvbench.diagnosis.model.batch import Batch
from agvbench.diagnosis.residuals.body_rates import Rates
from agvbench.diagnosis.terms.steering_history import lags_after
from agvbench.types import Floats

REACHES_RAD = (0.05, 0.1, 0.2, 0.4)
RECOVERIES_S = (0.2, 0.4, 0.8, 1.6)
LOADS_S = (0.5, 1.0, 2.0, 4.0, 8.0)
DEAD_BANDS = tuple(np.geomspace(0.01, 0.8, 72).tolist())
"""Widths of a dead band, as shares of the largest distance of a steering command from neutral."""
SLIPS_BEYOND = tuple(np.linspace(0.1, 0.95, 18).tolist())
"""Distances from neutral beyond which a linkage slips, as such shares."""


@dataclass(frozen=True)
class CommandHistory:
    """Tangents of the steady-state angles of both axles (n, 2) at each residual rate.

    They mean nothing for a differential vehicle. ``previous`` (n, 2): those under the previous
    steering command; ``reversal`` (n, 2): those at which each axle last reversed; ``levels`` (n, 3): index of the level
    of drive, front and rear in force; ``lags`` (n, 2, reaches): how far an axle lags behind by a hysteresis of each of
    `REACHES_RAD`; ``loads`` (n, times): what the servos have moved recently, by each of `RECOVERIES_S` [rad];
    ``creeps`` (n, 2, times): the same of each axle, with its sign; ``kept`` (n, 2, bands): how far the target that a
    servo obeys is from that of its command, by each of `DEAD_BANDS` [rad]; ``above`` and ``below`` (n, 2,
    distances): the number of the last command on either side of neutral beyond each of `SLIPS_BEYOND`, −1 before one;
    ``reach``: the largest distance of a steering command from neutral, in the vehicle's unit; ``drive_load`` (n,
    times): the mean commanded speed of the last seconds, by each of `LOADS_S` [m/s]; ``reversed_s`` (n,): how long ago
    the drive was commanded to the other direction [s], ∞ before that.
    """

    tangent: Floats
    previous: Floats
    reversal: Floats
    levels: NDArray[np.int64]
    lags: Floats
    loads: Floats
    creeps: Floats
    kept: Floats
    above: Floats
    below: Floats
    reach: float
    drive_load: Floats
    reversed_s: Floats


def command_history(batch: Batch, parameters: Floats, rates: Rates) -> CommandHistory:
    """Return the history at each rate, by the nodal values in `parameters`."""
    where, roles = batch.maps.slices(), ("front", "rear")
    angles = np.column_stack([batch.weights[role] @ parameters[where[role]] for role in roles])
    commands = np.column_stack([batch.commands[role] - getattr(batch.maps.neutral, role) for role in roles])
    reach = float(np.max(np.abs(commands)))
    axles = [_axles_at_rows(batch, commands[:, k], angles[:, k], reach) for k in range(len(roles))]
    previous, reversal, lags, kept, above, below = (np.stack(of, axis=1) for of in zip(*axles, strict=True))
    velocity = batch.weights["drive"] @ parameters[where["drive"]]
    speed, (load, reversed_at_s) = np.abs(velocity), _drive_at_rows(batch, velocity)
    rows, since_s = _rows(batch, rates)
    moved = _moves(batch, angles)[rows] * np.exp(-since_s[:, None, None] / RECOVERIES_S)
    levels = np.column_stack(
        [np.unique(batch.commands[role], return_inverse=True)[1][rows] for role in ("drive", *roles)]
    )
    now, before, at_reversal = np.tan(np.clip([angles, previous, reversal], -1.4, 1.4))[:, rows]
    return CommandHistory(
        now,
        before,
        at_reversal,
        levels=levels,
        lags=lags[rows],
        loads=moved[:, 0],
        creeps=moved[:, 1:],
        kept=kept[rows] - angles[rows, :, None],
        above=above[rows],
        below=below[rows],
        reach=reach,
        drive_load=load[rows] + (speed[rows, None] - load[rows]) * -np.expm1(-since_s[:, None] / LOADS_S),
        reversed_s=rates.covariates["time_in_run_s"] - reversed_at_s[rows],
    )


def _rows(batch: Batch, rates: Rates) -> tuple[NDArray[np.int64], Floats]:
    """Return the row of commands in force at each rate (n,), and how long it has been [s]."""
    rows, since_s = np.empty(len(rates.run), dtype=np.int64), np.empty(len(rates.run))
    for r in np.unique(rates.run):
        own = rates.run == r
        times, now = _times(batch, int(r)), rates.covariates["time_in_run_s"][own]
        at = np.searchsorted(times, now, side="right")
        rows[own] = batch.base.row_starts[r] + at
        since_s[own] = np.maximum(now - np.r_[times[:1], times][at], 0.0)
    return rows, since_s


def _times(batch: Batch, run: int) -> Floats:
    """Return the times of a run's commands that are simulated; its first row is what was commanded before."""
    first, last = batch.base.row_starts[run : run + 2]
    return batch.base.command_t_s[first + 1 : last]


class _Axle:
    """What one axle was commanded in a run so far: distances from neutral, and steady-state angles [rad].

    The attributes are those of `CommandHistory`, with the angle that a dead band keeps in ``kept``.
    """

    def __init__(self, command: float, angle: float, reach: float) -> None:
        self.command, self.angle, self.previous, self.reversal = command, angle, angle, angle
        self.bands, self.beyond = reach * np.array(DEAD_BANDS), reach * np.array(SLIPS_BEYOND)
        self.lags, self.above, self.below = np.zeros(len(REACHES_RAD)), *np.full((2, len(SLIPS_BEYOND)), -1.0)
        self.count = 0
        self.kept, self.kept_at = np.full(len(DEAD_BANDS), angle), np.full(len(DEAD_BANDS), command)

    def obey(self, command: float, angle: float) -> tuple[float, float, Floats, Floats, Floats, Floats]:
        """Turn to `angle`; return what `CommandHistory` calls previous, reversal, lags, kept, above and below."""
        travel = angle - self.angle
        if command != self.command:
            self.previous = self.angle
        if travel * (self.angle - self.reversal) < 0.0:
            self.reversal = self.angle
        if travel:
            self.lags = np.array(
                [lags_after(z, travel, reach) for z, reach in zip(self.lags, REACHES_RAD, strict=True)]
            )
        leaves = np.abs(command - self.kept_at) > self.bands
        self.kept, self.kept_at = np.where(leaves, angle, self.kept), np.where(leaves, command, self.kept_at)
        self.above = np.where(command > self.beyond, self.count, self.above)
        self.below = np.where(-command > self.beyond, self.count, self.below)
        self.command, self.angle, self.count = command, angle, self.count + 1
        return self.previous, self.reversal, self.lags, self.kept, self.above, self.below


def _axles_at_rows(batch: Batch, commands: Floats, angles: Floats, reach: float) -> list[Floats]:
    """Return what `_Axle.obey` does for each row of commands (rows,) with their angles (rows,)."""
    rows = []
    for first, last in pairwise(batch.base.row_starts.tolist()):
        axle = _Axle(commands[first], angles[first], reach)
        rows += [axle.obey(*row) for row in zip(commands[first:last], angles[first:last], strict=True)]
    return [np.array(column) for column in zip(*rows, strict=True)]


def _drive_at_rows(batch: Batch, velocity: Floats) -> tuple[Floats, Floats]:
    """Return the mean speed before each command (rows, times), and when the drive last reversed (rows,) [s]."""
    load, reversed_at_s = np.zeros((len(velocity), len(LOADS_S))), np.full(len(velocity), -np.inf)
    for r, (first, last) in enumerate(pairwise(batch.base.row_starts.tolist())):
        times = _times(batch, r)
        left = np.exp(-np.diff(times, prepend=times[0])[:, None] / LOADS_S)
        direction = np.sign(velocity[first])
        for row in range(first + 1, last):
            held = abs(velocity[row - 1])
            load[row] = held + (load[row - 1] - held) * left[row - first - 1]
            turns = velocity[row] * direction < 0.0
            reversed_at_s[row] = times[row - first - 1] if turns else reversed_at_s[row - 1]
            direction = np.sign(velocity[row]) or direction
    return load, reversed_at_s


def _moves(batch: Batch, angles: Floats) -> Floats:
    """Return what the servos have moved recently (rows, 3, times) right after each command.

    That is the sum of both amounts, and the way of either axle with its sign, for steady-state angles (rows, 2).
    """
    moves = np.zeros((len(angles), 3, len(RECOVERIES_S)))
    for r, (first, last) in enumerate(pairwise(batch.base.row_starts.tolist())):
        times = _times(batch, r)
        left = np.exp(-np.diff(times, prepend=times[0])[:, None] / RECOVERIES_S)
        ways = np.diff(angles[first:last], axis=0)
        ways = np.column_stack([np.abs(ways).sum(axis=1), ways])[:, :, None]
        for row in range(first + 1, last):
            moves[row] = moves[row - 1] * left[row - first - 1] + ways[row - first - 1]
    return moves
