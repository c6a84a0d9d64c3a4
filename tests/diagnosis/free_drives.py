"""Free driving of the vehicle of a few lines: a joystick that wanders, recorded from the middle of a drive."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from tiny_vehicle import HEADER, NEUTRAL, Tiny, drive

from agvbench.types import NO_TARGET, Commands, Frames, Pose, Run

FREE_HEADER = dataclasses.replace(HEADER, name="free", prediction_horizon_s=2.0, prediction_stride_s=1.0)
RECORDED_FROM_S, _PERIOD_S = 2.0, 0.1


def joystick(seconds: float, rng: np.random.Generator, reach: float = 1.0) -> Commands:
    """Return commands ten times a second: drive and both axles wander, each about as fast as a hand does.

    `reach` scales how far the axles are steered.
    """
    return Commands(
        _times(seconds),
        1150.0 + _wander(seconds, rng, 200.0, 1.5),
        NEUTRAL + _wander(seconds, rng, 350.0 * reach, 1.0),
        NEUTRAL + _wander(seconds, rng, 250.0 * reach, 1.3),
    )


def circling(seconds: float, rng: np.random.Generator) -> Commands:
    """Return the commands of a driver who stays about the same place, on circles of wandering radius."""
    commands = joystick(seconds, rng, reach=0.5)
    return dataclasses.replace(commands, front=commands.front + 250.0, rear=commands.rear - 150.0)


def calm(seconds: float, rng: np.random.Generator) -> Commands:
    """Return the commands of a driver who hardly changes the speed and turns the front axle slowly."""
    drive, front = 1150.0 + _wander(seconds, rng, 20.0, 1.5), NEUTRAL + _wander(seconds, rng, 350.0, 3.0)
    return Commands(_times(seconds), drive, front, np.full_like(front, NEUTRAL))


def stop_and_go(seconds: float, rng: np.random.Generator) -> Commands:
    """Return the commands of a driver who sets another speed every second or two, a quarter of the time none."""
    commands = joystick(seconds, rng)
    changes = np.cumsum(rng.random(len(commands)) < _PERIOD_S / 1.5)
    levels = rng.choice([1050.0, 1150.0, 1300.0, NEUTRAL], changes[-1] + 1)
    return dataclasses.replace(commands, drive=levels[changes])


def _times(seconds: float) -> np.ndarray:
    return _PERIOD_S * np.arange(round(seconds / _PERIOD_S))


def _wander(seconds: float, rng: np.random.Generator, size: float, every_s: float) -> np.ndarray:
    knots = np.arange(0.0, seconds + 2.0 * every_s, every_s)
    return np.round(size * np.interp(_times(seconds), knots, rng.uniform(-1.0, 1.0, len(knots))))


def free_runs(
    tiny: Tiny,
    *,
    seed: int = 0,
    sessions: int = 4,
    runs: int = 3,
    seconds: float = 30.0,
    by: Callable[[float, np.random.Generator], Commands] = joystick,
) -> list[Run]:
    """Drive `runs` in each of the sessions `by` hand; what is kept of each begins in the middle of the drive."""
    rng = np.random.default_rng([7, seed])
    out = []
    for session in range(sessions):
        for k in range(runs):
            commands = by(seconds, rng)
            started_s = 3600.0 * session + 120.0 * k
            frames = drive(tiny, commands, Pose(0.0, 0.0, rng.uniform(-3.0, 3.0)), started_s, rng)
            run = Run(f"{session}-{k}", "free", "", "", 0, NO_TARGET, started_s, "ok", "", *_later(commands, frames))
            out.append(dataclasses.replace(run, session=f"day {session}"))
    return out


def _later(commands: Commands, frames: Frames) -> tuple[Commands, Frames]:
    kept = frames.select(frames.t_s >= RECORDED_FROM_S)
    kept = dataclasses.replace(kept, t_s=kept.t_s - RECORDED_FROM_S)
    first = round(RECORDED_FROM_S / _PERIOD_S)
    values = (commands.drive[first:], commands.front[first:], commands.rear[first:])
    last = kept.t_s <= commands.t_s[-1] - RECORDED_FROM_S
    return Commands(commands.t_s[first:] - RECORDED_FROM_S, *values), kept.select(last)
