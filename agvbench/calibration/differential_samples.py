"""Samples of a differential vehicle: speed from straights, yaw rate from turns on the spot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agvbench.calibration.measurement.body_velocity import BodyVelocity, measure_body_velocity
from agvbench.calibration.samples import Sample
from agvbench.errors import FitError
from agvbench.types import Run
from agvbench.vehicle.channels import Role
from agvbench.vehicle.geometry import Geometry

_OTHER: dict[Role, Role] = {"drive": "front", "front": "drive"}
_MIN_COMMANDS = 4


def differential_samples(
    runs: Sequence[Run], geometry: Geometry, neutral: float
) -> tuple[list[Sample], dict[str, str]]:
    """Return samples of the drive and of the yaw rate, and why runs have none, by their ids.

    The speed's curve is read from runs whose yaw rate command is neutral and the yaw rate's from those whose speed
    command is, so that what the one costs the other (slip, unequal wheels) stays out of both. Where these vary their
    command too little, all runs are read.
    """
    measured: dict[str, BodyVelocity] = {}
    refused: dict[str, str] = {}
    for run in runs:
        try:
            measured[run.run_id] = measure_body_velocity(run, geometry, neutral=neutral)
        except FitError as error:
            refused[run.run_id] = str(error).removeprefix(f"run {run.run_id}: ")
    samples = [
        _sample(role, run, measured[run.run_id]) for role in _OTHER for run in _chosen(role, runs, measured, neutral)
    ]
    # It has no rear axle: the channel is fixed.
    samples += [Sample("rear", neutral, 0.0, np.nan, run_id) for run_id in list(measured)[:1]]
    return samples, refused


def _chosen(role: Role, runs: Sequence[Run], measured: dict[str, BodyVelocity], neutral: float) -> list[Run]:
    usable = [run for run in runs if run.run_id in measured]
    own = [run for run in usable if getattr(measured[run.run_id].command, _OTHER[role]) == neutral]
    commands = {getattr(measured[run.run_id].command, role) for run in own}
    return own if len(commands) >= _MIN_COMMANDS else usable


def _sample(role: Role, run: Run, m: BodyVelocity) -> Sample:
    value, stderr = (
        (m.forward_mps, m.forward_stderr_mps) if role == "drive" else (m.yaw_rate_radps, m.yaw_rate_stderr_radps)
    )
    return Sample(role, float(getattr(m.command, role)), value, stderr, run.run_id)
