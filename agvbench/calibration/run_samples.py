"""Samples from runs that held one command each: the calibration drives of fig. 7.1 and 7.2, and turns on the spot."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TypeVar

from agvbench.calibration.measurement.body_velocity import BodyVelocity
from agvbench.calibration.measurement.run_measurement import RunMeasurement
from agvbench.calibration.samples import Sample
from agvbench.errors import FitError
from agvbench.types import Command, Run
from agvbench.vehicle.channels import Role
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.kinematics import wheel_speed

Measured = TypeVar("Measured")
# Whose runs say most about a role; the next are asked where these vary its command too little.
_OWN: dict[Role, tuple[str, ...]] = {
    "front": ("steering_front", "steering_opposite"),
    "rear": ("steering_rear", "steering_opposite"),
    "drive": ("drive",),
}
_MIN_COMMANDS = 4
_STRAIGHT_RAD = math.radians(6.0)


def measure_runs(runs: Iterable[Run], measure: Callable[[Run], Measured]) -> tuple[dict[str, Measured], dict[str, str]]:
    """Return what `measure` says of each run by its id, and for the others why it raised `FitError`."""
    measured: dict[str, Measured] = {}
    refused: dict[str, str] = {}
    for run in runs:
        if not run.is_ok:
            refused[run.run_id] = run.status
            continue
        try:
            measured[run.run_id] = measure(run)
        except FitError as error:
            refused[run.run_id] = str(error).removeprefix(f"run {run.run_id}: ")
    return measured, refused


def arc_samples(runs: Sequence[Run], measured: dict[str, RunMeasurement], geometry: Geometry) -> list[Sample]:
    """Return what each run says about each role that its experiment was driven for.

    An axle's curve is read from the runs that vary this axle alone (tables 7.1, 7.2), so that the other axle's coupling
    stays out of it. The drive's is read from straight runs: what speed is lost in turns is an effect, not
    the map (appendix B). Its unit is speed along the wheels, by eq. 5.6.
    """
    samples: list[Sample] = []
    for role, experiments in _OWN.items():
        chosen = _chosen(role, experiments, runs, measured)
        samples += [_sample(role, measured[run.run_id], geometry) for run in chosen]
    return samples


def _chosen(
    role: Role, experiments: tuple[str, ...], runs: Sequence[Run], measured: dict[str, RunMeasurement]
) -> list[Run]:
    """Return the runs of the first experiments that vary the role's command enough, else all of them."""
    usable = [run for run in runs if run.run_id in measured]
    for count in range(1, len(experiments) + 1):
        among = [run for run in usable if run.experiment in experiments[:count]]
        if len({getattr(measured[run.run_id].command, role) for run in among}) >= _MIN_COMMANDS:
            return among
    return usable


def _sample(role: Role, m: RunMeasurement, geometry: Geometry) -> Sample:
    command = float(getattr(m.command, role))
    if role == "drive":
        return _drive_sample(command, m, geometry)
    value, stderr = getattr(m, f"{role}_rad"), getattr(m, f"{role}_stderr_rad")
    sample = Sample(role, command, value, stderr, m.run_id)
    return sample if m.moves else sample.without("the vehicle stood still: no angle to be seen")


def _drive_sample(command: float, m: RunMeasurement, geometry: Geometry) -> Sample:
    if not m.moves:  # what its frames drift is noise: a vehicle that stands has no speed
        return Sample("drive", command, 0.0, m.speed_stderr_mps, m.run_id)
    along = float(wheel_speed(math.cos(m.sideslip_rad), m.front_rad, m.rear_rad, geometry))
    sample = Sample("drive", command, along * m.speed_mps, along * m.speed_stderr_mps, m.run_id)
    if max(abs(m.front_rad), abs(m.rear_rad)) <= _STRAIGHT_RAD:
        return sample
    return sample.without("driven in a turn: what turning costs is an effect, not the map")


_OTHER: dict[Role, Role] = {"drive": "front", "front": "drive"}


def differential_samples(measured: Mapping[str, BodyVelocity], neutral: Command) -> list[Sample]:
    """Return what the runs of a differential vehicle, by id, say of its drive and of its yaw rate.

    The speed's curve is read from runs whose yaw rate command is neutral and the yaw rate's from those whose speed
    command is, so that what the one costs the other (slip, unequal wheels) stays out of both. Where these vary their
    command too little, all runs are read. It has no rear axle: this channel is fixed.
    """
    samples = [Sample("rear", neutral.rear, 0.0, math.nan, run_id) for run_id in list(measured)[:1]]
    for role, other in _OTHER.items():
        own = {name: m for name, m in measured.items() if getattr(m.command, other) == getattr(neutral, other)}
        varied = len({getattr(m.command, role) for m in own.values()}) >= _MIN_COMMANDS
        samples += [_body_sample(role, name, m) for name, m in (own if varied else measured).items()]
    return samples


def _body_sample(role: Role, run_id: str, m: BodyVelocity) -> Sample:
    value, stderr = m.forward_mps, m.forward_stderr_mps
    if role == "front":
        value, stderr = m.yaw_rate_radps, m.yaw_rate_stderr_radps
    return Sample(role, float(getattr(m.command, role)), value, stderr, run_id)


def described(refused: dict[str, str]) -> list[str]:
    """Return one sentence for each reason, with the runs it holds for."""
    reasons = Counter(refused.values())
    sentences = []
    for reason, count in reasons.items():
        first = next(run_id for run_id, why in refused.items() if why == reason)
        sentences.append(f"run {first} left out: {reason}" if count == 1 else f"{count} runs left out: {reason}")
    return sentences
