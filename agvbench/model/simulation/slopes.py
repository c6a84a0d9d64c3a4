"""Derivatives of the general simulation, by differences: each column over the runs that it touches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agvbench.types import Floats

if TYPE_CHECKING:
    from agvbench.model.simulation.simulation import Simulation, Slopes

Integers = NDArray[np.int64]

# Steps small beside what bends a prediction, large beside the error of integration: in a parameter's scale, in rad or
# m/s, and in m, rad or m/s.
_SHARE, _SETTLED_STEP, _INITIAL_STEP = 1e-3, 1e-4, 1e-4


def slopes(
    simulation: Simulation,
    settled: Floats,
    parameters: Floats,
    initial: Floats,
    directions: Floats | None,
    varied: Integers,
    initial_state: bool,
) -> Slopes:
    """Return the derivatives that `Simulation.jacobian` describes."""
    from agvbench.model.simulation.simulation import Slopes

    requested = np.empty((0, *settled.shape)) if directions is None else directions
    return Slopes(
        settled=_by_settled(simulation, settled, parameters, initial, requested),
        parameters=_by_parameters(simulation, settled, parameters, initial, varied),
        parameter_names=tuple(simulation.parameter_names[i] for i in varied),
        initial=_by_initial(simulation, settled, parameters, initial, range(4 if initial_state else 0)),
    )


def _by_settled(
    simulation: Simulation, settled: Floats, parameters: Floats, initial: Floats, directions: Floats
) -> Floats:
    out = np.zeros((len(directions), len(simulation.t_s), 3))
    for column, direction in zip(out, directions, strict=True):
        touched = np.unique(simulation.row_runs[np.any(direction != 0.0, axis=1)])
        if touched.size:
            step = _SETTLED_STEP / np.abs(direction).max()
            above, below = (
                simulation.predict(settled + sign * step * direction, parameters, initial, runs=touched)
                for sign in (1.0, -1.0)
            )
            frames = np.isin(simulation.frame_runs, touched)
            column[frames] = (above[frames] - below[frames]) / (2.0 * step)
    return out


def _by_parameters(
    simulation: Simulation, settled: Floats, parameters: Floats, initial: Floats, varied: Integers
) -> Floats:
    out = np.zeros((len(varied), len(simulation.t_s), 3))
    for column, i in zip(out, varied, strict=True):
        if not np.isfinite(parameters[i]):
            continue  # At a limit of infinity nothing changes.

        def moved(by: float, i: int = i) -> Floats:
            changed = parameters.copy()
            changed[i] += by
            return simulation.predict(settled, changed, initial)

        step = _SHARE * simulation.scales[i]
        if parameters[i] - step < simulation.lower[i]:
            column[:] = _one_sided(moved(0.0), moved(step), moved(2.0 * step)) / step
        elif parameters[i] + step > simulation.upper[i]:
            column[:] = -_one_sided(moved(0.0), moved(-step), moved(-2.0 * step)) / step
        else:
            column[:] = (moved(step) - moved(-step)) / (2.0 * step)
    return out


def _one_sided(here: Floats, near: Floats, far: Floats) -> Floats:
    return 2.0 * near - 1.5 * here - 0.5 * far


def _by_initial(simulation: Simulation, settled: Floats, parameters: Floats, initial: Floats, columns: range) -> Floats:
    out = np.zeros((len(columns), len(simulation.t_s), 3))
    for column, i in zip(out, columns, strict=True):
        above, below = initial.copy(), initial.copy()
        above[:, i] += _INITIAL_STEP
        below[:, i] -= _INITIAL_STEP
        difference = simulation.predict(settled, parameters, above) - simulation.predict(settled, parameters, below)
        column[:] = difference / (2.0 * _INITIAL_STEP)
    return out
