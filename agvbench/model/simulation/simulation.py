"""The simulation of many runs at once, with any effects.

::

    simulation = Simulation(model.geometry, model.neutral, runs)           # packed once
    settled = simulation.settled(front_map, rear_map, drive_map)           # (rows, 3), any maps
    p = simulation.parameters([SteeringLag(0.1)])                          # (p,), all else at null
    poses = simulation.predict(settled, p, initial)                        # (frames, 3)

A *row* is a command of a run; the first row of each run is the command, usually neutral, at which it stood before. All
runs' rows lie one after another (``row_starts``), and so do their frames (``frame_starts``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agvbench.effects import Effect, effect_kinds
from agvbench.effects.state import LOGGED_COUNT
from agvbench.errors import InputError, VehicleError
from agvbench.model.simulation.compose import kernel
from agvbench.model.simulation.hook_errors import check_hooks
from agvbench.model.simulation.layout import BANDWIDTH, INITIAL_SIZE, INITIAL_SPEED, RECENT_SPEED
from agvbench.model.simulation.threads import in_threads
from agvbench.types import Command, Commands, Floats
from agvbench.vehicle.geometry import Geometry

Integers = NDArray[np.int64]
Map = Callable[[Floats], ArrayLike]

_CHANNELS = ("drive", "front", "rear")


@dataclass(frozen=True)
class SimulatedRun:
    """The input of the simulation for one run.

    Parameters
    ----------
    commands
        Its commands, in the vehicle's unit.
    t_s
        Time stamps of the frames to predict [s], ascending, on the commands' clock.
    started_h
        Start of the run, in hours since the session began.
    begins_s
        Time stamp of the initial pose, for a window of free driving: commands before it move the actuators only. None
        for a run from rest, where the vehicle is at rest at the initial pose until its first command takes effect.
    preset
        Front and rear command at which the axles had settled before the first command; by default neutral.
    logged
        What was logged about the run, such as a temperature, standardised; at most `LOGGED_COUNT` numbers.
    """

    commands: Commands
    t_s: Floats
    started_h: float = 0.0
    begins_s: float | None = None
    preset: tuple[float, float] | None = None
    logged: tuple[float, ...] = ()

    def before(self, neutral: Command) -> dict[str, float]:
        """Return the command that held before the first one, by channel."""
        front, rear = self.preset or (neutral.front, neutral.rear)
        return {"drive": neutral.drive, "front": front, "rear": rear}


class Simulation:
    """A compiled simulation of many runs with every effect of the registry, composed in the order of the chain.

    Steps end where commands take effect and where the motion of an actuator has a kink. Predictions are therefore
    smooth in every parameter, delays and lags included. Effects at null do nothing and cost little: one kernel serves
    every combination.

    Parameters
    ----------
    geometry
        Positions of the axles.
    neutral
        The neutral command, in command units.
    runs
        At least one.
    kinds
        Effects outside the registry, such as discrepancy terms: classes at module level.

    Attributes
    ----------
    kinds : tuple of Effect classes
        All effects, those of the registry first.
    further_kinds : tuple of Effect classes
        Those that are not of the registry.
    parameter_names : tuple of str
        ``"steering_lag.time_constant_s"`` …, the order of every parameter vector.
    nulls, lower, upper, scales : ndarray, shape (p,)
        Of each parameter.
    drive, front, rear : ndarray, shape (rows,)
        Commands of each row, in the vehicle's unit.
    command_t_s : ndarray, shape (rows,)
        Time of the command of each row, −∞ for the first of a run: what was commanded before.
    row_starts, frame_starts : ndarray, shape (runs + 1,)
        Index of the first row and frame of each run.
    row_runs, frame_runs : ndarray, shape (rows,), (frames,)
        Index of the run of each row and frame.
    t_s : ndarray, shape (frames,)
        Stamps.
    begins_s : ndarray, shape (runs,)
        Time stamp of the initial pose of each window, NaN for runs from rest.

    Raises
    ------
    InputError
        If there is no run, or a run has no command, or times that are not finite or go back, or too much was logged.
    """

    def __init__(
        self,
        geometry: Geometry,
        neutral: Command,
        runs: Sequence[SimulatedRun],
        *,
        kinds: Sequence[type[Effect]] = (),
    ) -> None:
        _check_lengths(runs)
        self.geometry, self.neutral = geometry, neutral
        self.kinds, self.further_kinds = (*effect_kinds().values(), *kinds), tuple(kinds)
        declared = [(kind.name, p) for kind in self.kinds for p in kind.parameters()]
        self.parameter_names = tuple(f"{name}.{p.name}" for name, p in declared)
        self.nulls, self.lower, self.upper, self.scales = (
            np.array([getattr(p, what) for _, p in declared]) for what in ("null", "low", "high", "scale")
        )
        self._first_parameters = _starts([len(kind.parameters()) for kind in self.kinds])[:-1]
        starts = _starts([len(run.commands) for run in runs])
        self.row_starts = starts + np.arange(len(starts))
        self.frame_starts = _starts([len(run.t_s) for run in runs])
        self.row_runs = np.repeat(np.arange(len(runs)), np.diff(self.row_starts))
        self.frame_runs = np.repeat(np.arange(len(runs)), np.diff(self.frame_starts))
        self.drive, self.front, self.rear = (
            np.insert(
                _joined([getattr(run.commands, channel) for run in runs], starts, f"commands.{channel}"),
                starts[:-1],
                [run.before(neutral)[channel] for run in runs],
            )
            for channel in _CHANNELS
        )
        self.t_s = _joined([run.t_s for run in runs], self.frame_starts, "t_s", ascending=True)
        given_s = _joined([run.commands.t_s for run in runs], starts, "commands.t_s", ascending=True)
        self.command_t_s = np.insert(given_s, starts[:-1], -np.inf)
        self._from_neutral = np.column_stack([self.drive, self.front, self.rear]) - neutral
        self._started_h = np.array([run.started_h for run in runs], dtype=np.float64)
        self._logged = _logged(runs)
        self.begins_s = np.array([np.nan if run.begins_s is None else run.begins_s for run in runs])
        self._steps_s = np.array([kind.longest_step_s for kind in self.kinds for _ in kind.parameters()])
        self._all_runs = np.arange(len(runs))
        self._kernel = kernel(self.kinds)

    def __len__(self) -> int:
        return len(self._started_h)

    def settled(self, front: Map, rear: Map, drive: Map) -> Floats:
        """Return steady-state front and rear angle [rad] and speed [m/s] of every row, (rows, 3), by these maps."""
        columns = (front(self.front), rear(self.rear), drive(self.drive))
        return np.column_stack([np.broadcast_to(np.asarray(c, dtype=np.float64), self.drive.shape) for c in columns])

    def parameters(self, effects: Sequence[Effect] = ()) -> Floats:
        """Return the parameter vector with `effects`, and every other one at null.

        Raises
        ------
        VehicleError
            If an effect is not among `kinds`.
        """
        values = dict(zip(self.parameter_names, self.nulls, strict=True))
        for effect in effects:
            if type(effect) not in self.kinds:
                raise VehicleError("this effect is not part of the simulation", value=effect.name)
            values |= {f"{effect.name}.{name}": value for name, value in effect.values.items()}
        return np.array([values[name] for name in self.parameter_names])

    def effects(self, parameters: Floats) -> tuple[Effect, ...]:
        """Return the effects in a parameter vector that are not at null."""
        at, made = 0, []
        for kind in self.kinds:
            names = [p.name for p in kind.parameters()]
            made.append(kind(**dict(zip(names, map(float, parameters[at:]), strict=False))))
            at += len(names)
        return tuple(effect for effect in made if not effect.is_null)

    def indices(self, *effects: str) -> Integers:
        """Return the indices of the parameters of the effects called `effects` in a parameter vector."""
        wanted = [i for i, name in enumerate(self.parameter_names) if name.partition(".")[0] in effects]
        return np.array(wanted, dtype=np.int64)

    def predict(
        self,
        settled: Floats,
        parameters: Floats,
        initial: Floats,
        *,
        runs: ArrayLike | None = None,
        out: Floats | None = None,
        nodal_deviation: float = np.inf,
        later_s: Floats | None = None,
    ) -> Floats:
        """Return the predicted poses of every frame.

        Parameters
        ----------
        settled
            (rows, 3): steady-state front angle, rear angle and speed of every row; see `settled`.
        parameters
            (p,); see `parameters`. Nothing checks that they are within bounds.
        initial
            (runs, 4): the pose that the camera reports at the start (x, y, heading), and the longitudinal speed of the
            centroid (0 for a run from rest; NaN in a window: the speed that the commands before it result in). Effects
            of the camera change the following poses, not the initial one. Up to (runs, 8), in the order of `layout`:
            the recent longitudinal speed (averaged with weights that fall by e every 0.5 s), from which the drive's
            level is estimated. The yaw rate [rad/s] with which a window begins, to which the front axle is turned, and
            the share of this turn that is made (0: the angle remains that of the commands before it). The bandwidth
            [1/s] of the motion filter that found pose and speed, whose lag is compensated (∞: it has none).
        runs
            Indices of the runs to simulate; all by default. Other runs' frames are left as they are in `out`.
        out
            (frames, 3), written to if given.
        nodal_deviation
            Standard deviation of the logarithm of the recent speed over the speed that the commands before it result
            in. Beyond it, the drive is assumed to run at another level (battery, floor, temperature): every speed that
            is commanded then differs by the same amount. By default it never does.
        later_s
            (runs,): by how much later than its stamps each run's commands are given [s]; 0 by default.

        Returns
        -------
        ndarray
            (frames, 3): x, y [m], heading [rad], which is continuous and not wrapped.

        Raises
        ------
        InputError
            If a number is NaN.
        FileError
            If a hook of an effect cannot be compiled.
        """
        for what, values in (("parameters", parameters), ("settled", settled), ("initial", initial[:, :3])):
            if np.isnan(values).any():
                raise InputError("is not a number", where=what, value="NaN")
        poses = np.full((len(self.t_s), 3), np.nan) if out is None else out
        vehicle = [
            self.geometry.front_axle_m,
            self.geometry.rear_axle_m,
            self.geometry.front_drive_share,
            self._longest_step(parameters),
            0.0,
            nodal_deviation,
            float(self.geometry.is_differential),
        ]
        arguments = (
            np.append(parameters, np.logical_or.reduceat(parameters != self.nulls, self._first_parameters)),
            _whole(initial),
            self.begins_s,
            self._started_h,
            self._logged,
            self._from_neutral,
            np.ascontiguousarray(settled, dtype=np.float64),
            self.command_t_s if later_s is None else self.command_t_s + later_s[self.row_runs],
            self.row_starts,
            self.t_s,
            self.frame_starts,
        )

        def simulate(chosen: Integers) -> None:
            # The kernel keeps a working value in the array of the vehicle: each thread has its own.
            self._simulate(np.array(vehicle), *arguments, chosen, poses)

        in_threads(simulate, self._all_runs if runs is None else np.asarray(runs, dtype=np.int64))
        return poses

    def _simulate(self, *arguments: Floats | Integers) -> None:
        """Call the kernel; an error of compilation names the hook that it comes from."""
        try:
            self._kernel(*arguments)
        except Exception:
            check_hooks(self.kinds[::-1])  # the user's own ones first
            raise

    def _longest_step(self, parameters: Floats) -> float:
        return float(np.min(self._steps_s[parameters != self.nulls], initial=np.inf))

    def split(self, frames: Floats) -> list[Floats]:
        """Return an array over all frames as one per run."""
        return [frames[a:b] for a, b in pairwise(self.frame_starts.tolist())]


def _whole(initial: Floats) -> Floats:
    """Return how runs begin with every column of the layout, (runs, INITIAL_SIZE)."""
    whole = np.zeros((len(initial), INITIAL_SIZE))
    whole[:, RECENT_SPEED], whole[:, BANDWIDTH] = initial[:, INITIAL_SPEED], np.inf
    whole[:, : initial.shape[1]] = initial
    return whole


def _logged(runs: Sequence[SimulatedRun]) -> Floats:
    """Return what was logged about each run (runs, LOGGED_COUNT), filled up with zeros."""
    values = np.zeros((len(runs), LOGGED_COUNT))
    for i, run in enumerate(runs):
        if len(run.logged) > LOGGED_COUNT:
            raise InputError(
                "too many logged values", where=f"run {i}: logged", value=len(run.logged), limit=LOGGED_COUNT
            )
        values[i, : len(run.logged)] = run.logged
    return values


def _starts(counts: Sequence[int]) -> Integers:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def _check_lengths(runs: Sequence[SimulatedRun]) -> None:
    if not runs:
        raise InputError("a simulation needs a run")
    for i, run in enumerate(runs):
        if len(run.commands) == 0:
            raise InputError("a run needs a command", where=f"run {i}", remedy="give at least one row")
        if np.ndim(run.t_s) != 1:
            raise InputError("must have one dimension", where=f"run {i}: t_s", value=np.shape(run.t_s))
        for channel in _CHANNELS:
            length, limit = len(getattr(run.commands, channel)), len(run.commands.t_s)
            if length != limit:
                where = f"run {i}: commands.{channel}"
                raise InputError("has another length than t_s", where=where, value=length, limit=limit)


def _joined(arrays: Sequence[Floats], starts: Integers, what: str, *, ascending: bool = False) -> Floats:
    """Return the arrays of all runs one after another; raise `InputError` where one is not finite or descends."""
    values = np.concatenate(arrays, dtype=np.float64)
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise InputError("is not finite", where=_place(starts, bad[0], what), value=values[bad[0]])
    if ascending:
        back = 1 + np.flatnonzero(np.diff(values) < 0.0)
        back = back[~np.isin(back, starts)]
        if back.size:
            value = f"{values[back[0]]:.6g} s after {values[back[0] - 1]:.6g} s"
            raise InputError("time goes back", where=_place(starts, back[0], what), value=value, remedy="sort by time")
    return values


def _place(starts: Integers, index: int, what: str) -> str:
    run = int(np.searchsorted(starts, index, side="right")) - 1
    return f"run {run}: {what}[{index - starts[run]}]"
