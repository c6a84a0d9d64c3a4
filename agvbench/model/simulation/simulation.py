"""The general simulation: many runs at once, with any effects, and its derivatives.

::

    simulation = Simulation(model.geometry, model.neutral, runs)           # packed once
    settled = simulation.settled(front_map, rear_map, drive_map)           # (rows, 3), any maps
    p = simulation.parameters([SteeringLag(0.1)])                          # (p,), all else at null
    poses = simulation.predict(settled, p, initial)                        # (frames, 3)
    slopes = simulation.jacobian(settled, p, initial, effects=["steering_lag"], initial_state=True)

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
from agvbench.errors import InputError, VehicleError
from agvbench.model.simulation.compose import kernel
from agvbench.model.simulation.simulated_run import SimulatedRun, check_runs
from agvbench.types import Floats
from agvbench.vehicle.geometry import Geometry

Integers = NDArray[np.int64]
Map = Callable[[Floats], ArrayLike]

STEP_S = 0.025


@dataclass(frozen=True)
class Slopes:
    """Derivatives of poses (x, y, heading), each of shape (columns, frames, 3).

    ``settled`` has a column per direction asked for, ``parameters`` one per parameter asked for
    (``parameter_names``), ``initial`` one each for x, y, heading and speed at the start of the frame's own run.
    """

    settled: Floats
    parameters: Floats
    parameter_names: tuple[str, ...]
    initial: Floats


class Simulation:
    """A compiled simulation of many runs with every effect of the registry, composed in the order of the chain.

    Steps are aligned with the moments at which commands take effect and with the kinks of the actuators' way, so
    predictions are smooth in every parameter, delays and lags included. Effects at null do nothing and cost little: one
    kernel serves every combination.

    Parameters
    ----------
    geometry
        Where the axles are.
    neutral
        The neutral command, in command units.
    runs
        At least one.
    step_s
        Longest step [s] while an effect is `local`; else steps are as long as the motion allows.
    kinds
        Further effects than those of the registry, say empirical terms: classes in a module of their own.

    Attributes
    ----------
    kinds : tuple of Effect classes
        All effects, those of the registry first.
    parameter_names : tuple of str
        ``"steering_lag.time_constant_s"`` …, the order of every parameter vector.
    nulls, lower, upper, scales : ndarray, shape (p,)
        Of each parameter.
    drive, front, rear : ndarray, shape (rows,)
        Commands of each row, in the vehicle's unit.
    row_starts, frame_starts : ndarray, shape (runs + 1,)
        Where each run's rows and frames begin.
    row_runs, frame_runs : ndarray, shape (rows,), (frames,)
        Which run each row or frame belongs to.
    t_s : ndarray, shape (frames,)
        Stamps.

    Raises
    ------
    InputError
        If there is no run, or a run has no command, or times that are not finite or go back.
    """

    def __init__(
        self,
        geometry: Geometry,
        neutral: float,
        runs: Sequence[SimulatedRun],
        *,
        step_s: float = STEP_S,
        kinds: Sequence[type[Effect]] = (),
    ) -> None:
        check_runs(runs)
        if not step_s > 0.0:
            raise InputError("must be greater than zero", where="step_s", value=f"{step_s:g} s")
        self.geometry, self.neutral, self.step_s = geometry, neutral, step_s
        self.kinds = (*effect_kinds().values(), *kinds)
        declared = [(kind.name, p) for kind in self.kinds for p in kind.parameters()]
        self.parameter_names = tuple(f"{name}.{p.name}" for name, p in declared)
        self.nulls, self.lower, self.upper, self.scales = (
            np.array([getattr(p, what) for _, p in declared]) for what in ("null", "low", "high", "scale")
        )
        self.row_starts = _starts([len(run.commands) + 1 for run in runs])
        self.frame_starts = _starts([len(run.t_s) for run in runs])
        self.row_runs = np.repeat(np.arange(len(runs)), np.diff(self.row_starts))
        self.frame_runs = np.repeat(np.arange(len(runs)), np.diff(self.frame_starts))
        self.drive, self.front, self.rear = (
            np.concatenate([[run.before(neutral)[channel], *getattr(run.commands, channel)] for run in runs])
            for channel in ("drive", "front", "rear")
        )
        self.t_s = np.concatenate([np.asarray(run.t_s, dtype=np.float64) for run in runs])
        self._from_neutral = np.column_stack([self.drive, self.front, self.rear]) - neutral
        self._command_t_s = np.concatenate([[-np.inf, *run.commands.t_s] for run in runs])
        self._started_h = np.array([run.started_h for run in runs], dtype=np.float64)
        self._begins_s = np.array([np.nan if run.begins_s is None else run.begins_s for run in runs])
        self._local = np.array([kind.local for kind in self.kinds for _ in kind.parameters()])
        self._all_runs = np.arange(len(runs))
        self._kernel = kernel(self.kinds)

    def __len__(self) -> int:
        return len(self._started_h)

    def settled(self, front: Map, rear: Map, drive: Map) -> Floats:
        """Return (rows, 3): settled front and rear angle [rad] and speed [m/s] of every row, by these maps."""
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
        """Return where the parameters of the effects called `effects` are in a parameter vector."""
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
    ) -> Floats:
        """Return the predicted poses of every frame.

        Parameters
        ----------
        settled
            (rows, 3): settled front angle, rear angle, speed of every row; see `settled`.
        parameters
            (p,); see `parameters`. Nothing checks that they are within bounds.
        initial
            (runs, 4): what the camera reports at the start (x, y, heading), and the speed of the centroid ahead (0 for
            a run from rest; NaN in a window: what the commands before it have made it). Effects of the camera change
            what follows, not the start itself. With a fifth column: the speed ahead lately (averaged with weights that
            fall by e every 0.5 s), from which the drive's level is read.
        runs
            Indices of the runs to simulate; all by default. Other runs' frames are left as they are in `out`.
        out
            (frames, 3), written to if given.
        level_scatter
            How far, as a logarithm, the speed lately may be from what the commands before it have made it by mere
            scatter. Where it is farther, the drive is taken to run at another level (battery, floor, temperature),
            and whenever it is told to go its speed is faster or slower by the same amount. By default it never is.

        Returns
        -------
        ndarray
            (frames, 3): x, y [m], heading [rad], which is continuous and not wrapped.

        Raises
        ------
        InputError
            If a number is NaN.
        """
        for what, values in (("parameters", parameters), ("settled", settled), ("initial", initial[:, :3])):
            if np.isnan(values).any():
                raise InputError("is not a number", where=what, value="NaN")
        poses = np.full((len(self.t_s), 3), np.nan) if out is None else out
        self._kernel(
            np.array(
                [
                    self.geometry.front_axle_m,
                    self.geometry.rear_axle_m,
                    self._longest_step(parameters),
                    0.0,
                    nodal_deviation,
                ]
            ),
            np.ascontiguousarray(parameters, dtype=np.float64),
            np.ascontiguousarray(initial, dtype=np.float64),
            self._begins_s,
            self._started_h,
            self._from_neutral,
            np.ascontiguousarray(settled, dtype=np.float64),
            self._command_t_s,
            self.row_starts,
            self.t_s,
            self.frame_starts,
            self._all_runs if runs is None else np.asarray(runs, dtype=np.int64),
            poses,
        )
        return poses

    def jacobian(
        self,
        settled: Floats,
        parameters: Floats,
        initial: Floats,
        *,
        directions: Floats | None = None,
        effects: Sequence[str] = (),
        initial_state: bool = False,
    ) -> Slopes:
        """Return derivatives by central differences, one-sided (second order) where a bound is near.

        Each column takes two simulations of the runs that it touches.

        Parameters
        ----------
        settled, parameters, initial
            Where; as for `predict`.
        directions
            (q, rows, 3): directions in `settled`, say the derivatives of the maps with respect to their own
            parameters, or ones in a column for an offset in every run.
        effects
            Names of effects whose parameters are varied.
        initial_state
            Whether x, y, heading and speed at the start are varied.
        """
        from agvbench.model.simulation.slopes import slopes

        return slopes(self, settled, parameters, initial, directions, self.indices(*effects), initial_state)

    def _longest_step(self, parameters: Floats) -> float:
        return self.step_s if np.any(parameters[self._local] != self.nulls[self._local]) else np.inf

    def split(self, frames: Floats) -> list[Floats]:
        """Return an array over all frames as one per run."""
        return [frames[a:b] for a, b in pairwise(self.frame_starts.tolist())]


def _starts(counts: Sequence[int]) -> Integers:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
