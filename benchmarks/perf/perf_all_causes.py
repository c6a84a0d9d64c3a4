"""What a diagnosis says of vehicles that have all their causes at once: `random_plant`, one campaign a seed.

    python benchmarks/perf/perf_all_causes.py --vehicles 20 --first-seed 9601 --out DIR [--json FILE]

The truth comes from removal: each cause is taken from the simulated vehicle, the commands of the campaign are driven
again without random variation, and the rms shift of the end positions is compared with the repeatability. A cause whose
removal shifts them by at least three times the repeatability has to be named, or to be among the rivals of a name.

The repeatability that a diagnosis states comes from few repeats of the test runs. The *known* repeatability is that of
further repeats of the same runs by the simulated vehicle. A few test runs may scatter more or less than that: the error
of a *perfect model* is the scatter of the test runs themselves about the mean of those repeats. The error is held
against all three.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

os.environ.update(dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"))

import numpy as np
import pandas as pd
from corpus import drive

from agvbench.campaign import Campaign
from agvbench.diagnosis import Diagnosis, diagnose
from agvbench.diagnosis.data.readings import read_runs
from agvbench.diagnosis.data.splits import split_runs
from agvbench.simulator.plants import THESIS_VEHICLE, random_vehicle
from agvbench.simulator.vehicle_parameters import RunVariation, SimulatedVehicle
from agvbench.simulator.vehicle_plant import VehiclePlant
from agvbench.types import Floats, Run

DECISIVE = 3.0
"""Times the repeatability: a cause that shifts the end positions by more has to be found."""
NOMINAL_FRONT_M, NOMINAL_REAR_M = 0.181, 0.121
FRAME_S = 0.02
FURTHER_REPEATS = 6


@dataclass(frozen=True)
class Cause:
    """A cause of a simulated vehicle: the vehicle ``without`` it, and the ``names`` of effects that describe it."""

    without: SimulatedVehicle
    names: frozenset[str]


def causes(vehicle: SimulatedVehicle) -> dict[str, Cause]:
    """Return the causes of a vehicle by name; no effect describes those without names."""
    drive_train, body = vehicle.drive, vehicle.body

    def axle(servo: str) -> Any:
        return replace(
            getattr(vehicle, servo), natural_frequency_rad_per_s=250.0, damping_ratio=1.0, rate_limit_rad_per_s=1e3
        )

    fast = {side: replace(getattr(vehicle, side), acceleration_mps2=1e3) for side in ("forward", "backward")}
    stiff = replace(drive_train, stiffness_per_s=250.0, brake_per_s=250.0, windup_per_s2=0.0, backlash_m=0.0)
    centred = replace(body, front_axle_m=NOMINAL_FRONT_M, rear_axle_m=NOMINAL_REAR_M, marker_left_m=0.0)
    without: dict[str, tuple[SimulatedVehicle, set[str]]] = {
        # The pulse frame delays a command by half its length on average, so that every vehicle has a delay.
        "delay": (replace(vehicle, delay_frames=0.0), {"actuation_delay", "mocap_latency"}),
        "servos": (replace(vehicle, front=axle("front"), rear=axle("rear")), {"steering_lag", "steering_rate_limit"}),
        "speed": (replace(vehicle, drive=stiff, **fast), {"speed_lag"}),
        "backlash of the drive train": (replace(vehicle, drive=replace(drive_train, backlash_m=0.0)), {"speed_lag"}),
        "spring-back": (replace(vehicle, drive=replace(drive_train, windup_per_s2=0.0)), {"speed_lag"}),
        "speed in turns": (
            replace(vehicle, drive=replace(drive_train, overrun=1.0, scrub=0.0, scrub_dry_mps=0.0)),
            {"cornering_speed_loss", "axle_overrun"},
        ),
        "axle speeds": (replace(vehicle, drive=replace(drive_train, rear_speed_ratio=1.0)), {"axle_speed_mismatch"}),
        "lever arm": (replace(vehicle, body=centred), {"marker_offset"}),
        "reverse": (replace(vehicle, body=replace(body, reverse_relief=0.0)), {"reverse_steering_gain"}),
        "battery": (replace(vehicle, battery=replace(vehicle.battery, droop=0.0)), {"battery_droop"}),
    }
    return {
        name: Cause(reduced, frozenset(names))
        for name, (reduced, names) in without.items()
        if name == "delay" or reduced != vehicle
    }


def end_positions(vehicle: SimulatedVehicle, runs: list[Run]) -> Floats:
    """Return where the runs end (runs, 2) [m] when this vehicle drives their commands, without random variation."""
    plant = VehiclePlant(replace(vehicle, run_variation=RunVariation(0.0, 0.0, 0.0)), 0)
    return np.asarray([end_position(plant, run, 1) for run in runs])


def end_position(plant: VehiclePlant, run: Run, seed: int) -> tuple[float, float]:
    """Return where a run ends [m] when the plant drives its commands from its start pose."""
    frames, commands = run.frames, run.commands
    first = int(np.argmax(frames.tracked))
    pose = (float(frames.x_m[first]), float(frames.y_m[first]), float(frames.heading_rad[first]))
    plant.reset(pose, seed=seed)
    until = np.append(commands.t_s[1:], max(float(frames.t_s[-1]), float(commands.t_s[-1])))
    rows = zip(commands.drive, commands.front, commands.rear, until - commands.t_s, strict=True)
    for drive_us, front_us, rear_us, dt in rows:
        pose = plant.advance(float(drive_us), float(front_us), float(rear_us), float(dt))
    return pose[:2]


def repeatability_mm(vehicle: SimulatedVehicle, campaign: Campaign) -> tuple[float, float]:
    """Return the scatter of end positions about the mean of further repeats, rms over the test runs [mm].

    First that of these repeats, then that of the test runs themselves: the error that a perfect model has on them. The
    variance of the mean is taken out of the latter.
    """
    neutral = campaign.header.neutral
    readings = read_runs([run for run in campaign if run.is_ok], neutral)
    test = split_runs(readings.runs, readings.group, neutral, 0).test
    plant, variances, squares = VehiclePlant(vehicle, 5), [], []
    for k in np.flatnonzero(test):
        seeds = FURTHER_REPEATS * (int(k) + 1) + np.arange(FURTHER_REPEATS)
        ends = np.asarray([end_position(plant, readings.runs[k], int(seed)) for seed in seeds])
        seen = readings.poses[k, np.isfinite(readings.poses[k, :, 0]), :2]
        variances.append(float(np.sum(np.var(ends, axis=0, ddof=1))))
        squares.append(float(np.sum((seen[-1] - ends.mean(axis=0)) ** 2)))
    known = float(np.mean(variances))
    perfect = max(float(np.mean(squares)) - known / FURTHER_REPEATS, 0.0)
    return 1e3 * float(np.sqrt(known)), 1e3 * float(np.sqrt(perfect))


def shifts_mm(vehicle: SimulatedVehicle, runs: list[Run]) -> dict[str, float]:
    """Return by how much the end positions move without each cause: rms over the runs [mm]."""
    whole = end_positions(vehicle, runs)
    moved = {name: end_positions(cause.without, runs) - whole for name, cause in causes(vehicle).items()}
    return {name: 1e3 * float(np.sqrt(np.mean(np.sum(shift**2, axis=1)))) for name, shift in moved.items()}


def true_values(vehicle: SimulatedVehicle) -> dict[tuple[str, str], float]:
    """Return the parameters that the simulator and an effect share, by effect and parameter."""
    return {
        ("reverse_steering_gain", "gain"): -vehicle.body.reverse_relief,
        ("marker_offset", "forward_m"): NOMINAL_FRONT_M - vehicle.body.front_axle_m,
        ("marker_offset", "left_m"): vehicle.body.marker_left_m,
        ("actuation_delay", "delay_s"): FRAME_S * (vehicle.delay_frames + 0.5),
    }


@dataclass(frozen=True)
class Answer:
    """What was found of one vehicle: its ``decisive`` causes by shift [mm], which were ``found``, and each name."""

    vehicle: str
    verdict: str
    seconds: float
    decisive: Mapping[str, float]
    found: tuple[str, ...]
    true_names: tuple[str, ...]
    wrong_names: tuple[str, ...]
    errors: Mapping[str, float]
    covered: Mapping[str, tuple[float, float, float]]


def judged(name: str, vehicle: SimulatedVehicle, campaign: Campaign, found: Diagnosis, seconds: float) -> Answer:
    """Hold a diagnosis against the truth."""
    errors = dict(found.held_out.errors["end_position_mm"]) if found.held_out is not None else {}
    errors["known"], errors["perfect"] = repeatability_mm(vehicle, campaign)
    runs = [run for run in campaign if run.is_ok]
    moved = shifts_mm(vehicle, runs)
    threshold = DECISIVE * errors.get("floor", float("nan"))
    known = causes(vehicle)
    rivals = {effect.name: {effect.name, *effect.confounded_with} for effect in found.effects}
    said = frozenset().union(*rivals.values()) if rivals else frozenset()
    present = frozenset().union(*(cause.names for cause in known.values()))
    decisive = {cause: shift for cause, shift in moved.items() if shift >= threshold and known[cause].names}
    truth = true_values(vehicle)
    return Answer(
        name,
        str(found.verdict),
        seconds,
        decisive,
        tuple(cause for cause in decisive if known[cause].names & said),
        tuple(effect for effect, names in rivals.items() if names & present),
        tuple(effect for effect, names in rivals.items() if not names & present),
        errors,
        {
            f"{effect.name}.{key}": (estimate.value, estimate.stderr, truth[effect.name, key])
            for effect in found.effects
            for key, estimate in effect.parameters.items()
            if (effect.name, key) in truth
        },
    )


def examine(folder: Path, seed: int) -> Answer:
    """Drive the campaign of one vehicle if it is missing, diagnose it, and judge the answer. Seed 0: the default."""
    name = f"drawn-{seed}" if seed else "default"
    options = ["--plant=agvbench.simulator:random_plant", f"--seed={seed}"] if seed else ["--seed=9520"]
    if not (folder / name).exists():
        print(drive(folder, name, options), flush=True)
    campaign = Campaign.open(folder / name)
    began = time.process_time()
    found = diagnose(campaign)
    seconds = time.process_time() - began
    vehicle = random_vehicle(seed) if seed else THESIS_VEHICLE
    answer = judged(name, vehicle, campaign, found, seconds)
    print(line(answer), flush=True)
    return answer


def line(answer: Answer) -> str:
    """Return one answer as a line."""
    missed = [f"{cause} ({shift:.0f} mm)" for cause, shift in answer.decisive.items() if cause not in answer.found]
    errors = " → ".join(f"{answer.errors.get(key, float('nan')):.1f}" for key in ("before", "after"))
    return (
        f"{answer.vehicle}: {answer.verdict}, found {len(answer.found)} of {len(answer.decisive)}"
        + (f", missed {', '.join(missed)}" if missed else "")
        + f"; true names {', '.join(answer.true_names) or 'none'}; wrong {', '.join(answer.wrong_names) or 'none'}; "
        f"{errors} mm, repeatability {answer.errors.get('floor', float('nan')):.1f}, "
        f"known {answer.errors['known']:.1f}, perfect model {answer.errors['perfect']:.1f}; {answer.seconds:.0f} s"
    )


def summary(answers: list[Answer]) -> str:
    """Return the shares over all vehicles."""
    decisive = sum(len(answer.decisive) for answer in answers)
    found = sum(len(answer.found) for answer in answers)
    true = sum(len(answer.true_names) for answer in answers)
    names = true + sum(len(answer.wrong_names) for answer in answers)
    checks = pd.Series([abs(v - t) <= 1.96 * s for a in answers for v, s, t in a.covered.values()], dtype=bool)
    ratios = {
        name: [a.errors["after"] / a.errors[key] for a in answers if a.errors.get(key) and "after" in a.errors]
        for name, key in (
            ("repeatability", "floor"),
            ("known repeatability", "known"),
            ("a perfect model's", "perfect"),
        )
    }
    over = "; ".join(f"over {name}: median {np.median(r):.2f}, at most {np.max(r):.2f}" for name, r in ratios.items())
    return (
        f"{len(answers)} vehicles: decisive causes found {found} of {decisive}, names true {true} of {names}, "
        f"95 % intervals that hold the true value {int(checks.sum())} of {len(checks)}, "
        f"error after {over}"
    )


def main() -> int:
    """Read the command line, examine the vehicles, and print the summary."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=9601, help="0: the default vehicle alone")
    parser.add_argument("--out", type=Path, required=True, help="directory of the campaigns; existing ones are reused")
    parser.add_argument("--json", type=Path, help="write every answer to this file")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.vehicles) if arguments.first_seed else (0,)
    with ProcessPoolExecutor(arguments.jobs) as pool:
        answers = list(pool.map(partial(examine, arguments.out), seeds))
    print(summary(answers))
    if arguments.json:
        arguments.json.write_text(json.dumps([asdict(answer) for answer in answers], indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
