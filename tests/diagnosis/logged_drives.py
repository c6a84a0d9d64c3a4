"""Campaigns of the vehicle of a few lines under conditions that a lab logs: battery, temperature, operator."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
from tiny_vehicle import Tiny, drive, experiments

from agvbench.types import NO_TARGET, Pose, Run

Conditions = Callable[[float, np.random.Generator], tuple[Tiny, dict[str, object]]]
"""What is true of the vehicle in a run that begins after so many hours, and what the lab logs of the run."""

_HOURS = 1.0


def logged_runs(conditions: Conditions, *, seed: int = 0, steps: bool = False) -> list[Run]:
    """Return a campaign whose runs have these conditions: repeats interleaved, start poses at random."""
    rng, own = np.random.default_rng(seed), np.random.default_rng([seed, 1])
    plan = [
        (name, commands, repeat, k)
        for k, (name, commands, repeats) in enumerate(experiments(steps=steps))
        for repeat in range(1, max(repeats, 3) + 1)
    ]
    plan.sort(key=lambda row: (row[2], rng.random()))
    runs = []
    for i, (name, commands, repeat, k) in enumerate(plan):
        hours = _HOURS * i / len(plan)
        tiny, logged = conditions(hours, own)
        start = Pose(*rng.uniform(-0.7, 0.7, 2), rng.uniform(-math.pi, math.pi))
        frames = drive(tiny, commands, start, 3600.0 * hours, rng)
        ids = (f"{i:03d}-{name}-{k}", name, "", "calibrated", repeat, NO_TARGET, 3600.0 * hours)
        runs.append(Run(*ids, "ok", "tiny", commands, frames, extra=logged))
    return runs


def by_battery(hours: float, rng: np.random.Generator) -> tuple[Tiny, dict[str, object]]:
    """The speed depends on a voltage that does not depend on time: packs are exchanged between runs."""
    volt = rng.uniform(7.2, 8.4)
    return Tiny(speed_factor=1.0 + 0.08 * (volt - 7.8)), {"battery_V": volt}


def by_temperature(hours: float, rng: np.random.Generator) -> tuple[Tiny, dict[str, object]]:
    """The steering gain depends on a temperature."""
    celsius = rng.uniform(15.0, 30.0)
    return Tiny(steering_factor=1.0 - 0.006 * (celsius - 22.0)), {"temperature_C": f"{celsius:.1f}"}


def by_operator(hours: float, rng: np.random.Generator) -> tuple[Tiny, dict[str, object]]:
    """One of two operators leaves the front axle with a trim."""
    operator = str(rng.choice(["anna", "bo"]))
    return Tiny(front_trim_rad=0.02 if operator == "bo" else 0.0), {"operator": operator}


def by_time(hours: float, rng: np.random.Generator) -> tuple[Tiny, dict[str, object]]:
    """The speed falls with time, and a temperature that matters nothing is logged."""
    return Tiny(droop_per_hour=0.0, speed_factor=1.0 - 0.05 * (hours > 0.5)), {"temperature_C": rng.normal(20.0, 1.0)}


def by_chance(hours: float, rng: np.random.Generator) -> tuple[Tiny, dict[str, object]]:
    """Nothing is hidden, and five columns are logged; some values are missing."""
    logged: dict[str, object] = {
        "battery_V": 8.4 - hours + rng.normal(0.0, 0.05),
        "temperature_C": rng.normal(20.0, 1.0),
        "humidity": rng.uniform(0.2, 0.8) if rng.random() < 0.8 else math.nan,
        "operator": str(rng.choice(["anna", "bo", "cy"])),
        "wheel_set": str(rng.choice(["A", "B"])),
    }
    return Tiny(), logged


def without_columns(runs: list[Run]) -> list[Run]:
    """Return the same runs with nothing logged."""
    return [dataclasses.replace(run, extra={}) for run in runs]
