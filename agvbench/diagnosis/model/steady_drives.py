"""Initial values of nodal maps: what runs that settled to one command say of each channel."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial

import numpy as np

from agvbench.calibration import RunMeasurement, measure_body_velocity, measure_run
from agvbench.calibration.run_samples import measure_runs
from agvbench.diagnosis.model.nodal_maps import ROLES, NodalMaps
from agvbench.types import Command, Floats, Run
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.kinematics import wheel_speed

_MIN_SPEED_MPS = 0.02
SteadyDrive = tuple[Command, Mapping[str, float]]
"""A command, and the steady-state value of each channel [rad, rad/s, m/s]; NaN where the run does not tell."""


def steady_drives(runs: Iterable[Run], geometry: Geometry, neutral: Command) -> list[SteadyDrive]:
    """Return what each run with a steady part says of the channels, by inverted kinematics.

    A run without one gives no initial value, but remains in the fit.
    """
    if geometry.is_differential:
        turned, _ = measure_runs(runs, partial(measure_body_velocity, geometry=geometry, neutral=neutral))
        return [(m.command, {"front": m.yaw_rate_radps, "drive": m.forward_mps}) for m in turned.values()]
    measured, _ = measure_runs(runs, partial(measure_run, geometry=geometry, neutral=neutral))
    return [(m.command, _of_arc(m, geometry)) for m in measured.values()]


def _of_arc(m: RunMeasurement, geometry: Geometry) -> dict[str, float]:
    turns = abs(m.speed_mps) > _MIN_SPEED_MPS
    return {
        "front": m.front_rad if turns else np.nan,
        "rear": m.rear_rad if turns else np.nan,
        "drive": _along_wheels(m, geometry) if m.moves else 0.0,
    }


def _along_wheels(m: RunMeasurement, geometry: Geometry) -> float:
    return float(wheel_speed(m.speed_mps * np.cos(m.sideslip_rad), m.front_rad, m.rear_rad, geometry))


def start_values(maps: NodalMaps, drives: Sequence[SteadyDrive], prior_model: Mapping[str, Floats]) -> Floats:
    """Return the nodal values at which a fit starts: those of steady drives, the median of each command.

    At nodes without a steady drive they are those of the prior model (`prior_model[role]`, values at the nodes), plus
    its error interpolated from the measured nodes. A fit from a distant start may end in another local minimum.
    """
    values = []
    for role in ROLES:
        nodes = maps.nodes[role]
        known = np.full(len(nodes), np.nan)
        for k, node in enumerate(nodes):
            implied = [values[role] for command, values in drives if getattr(command, role) == node]
            implied = [v for v in implied if np.isfinite(v)]
            if implied:
                known[k] = float(np.median(implied))
        measured_here = np.isfinite(known)
        error = (known - prior_model[role])[measured_here]
        moved = prior_model[role] + (np.interp(nodes, nodes[measured_here], error) if len(error) else 0.0)
        values.append(np.where(measured_here, known, moved))
    return np.concatenate(values)
