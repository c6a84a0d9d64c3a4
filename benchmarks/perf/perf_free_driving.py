"""How long the diagnosis of free driving takes: ten minutes at 100 Hz, in ten sessions, on one core.

The plants of the simulator (`agvbench.simulator`) are driven by random steps, and seen by a camera with noise: a
two-axle and a differential vehicle as they ship, with all their causes, and vehicles drawn at random. Those that ship
are also driven by hand: a joystick that moves to its next place in 0.2 s, and is read 50 times a second with 8 bits.
Time is that of the process; each diagnosis is made twice, since the first one compiles. There is no peer that does the
same, so that the figures stand beside the bound of 60 s and the time of a fixed task (`perf_diagnose.yardstick`).
Run with ``python benchmarks/perf/perf_free_driving.py [--seeds N] [--minutes M] [--rate HZ]``.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from perf_diagnose import Part, yardstick
from scipy.signal import lfilter

from agvbench.campaign import CampaignHeader
from agvbench.diagnosis import diagnose
from agvbench.simulator import Plant, differential_plant, make_plant, random_differential_plant, random_plant
from agvbench.types import NO_TARGET, Commands, Frames, Run
from agvbench.vehicle.channels import Channels

SESSIONS, BOUND_S = 10, 60.0
STEPS_S, BY_HAND_S = 0.1, 0.02
"""Intervals of the commands of both drivers."""
JOYSTICK_S, JOYSTICK_LEVELS = 0.2, 127
NOISE_M, NOISE_RAD = 3e-4, 8e-4


@dataclass(frozen=True)
class Kind:
    """A kind of vehicle: its header, and neutral and range of its commands."""

    header: CampaignHeader
    neutral: float
    drive: float
    steering: float

    @classmethod
    def of(cls, *, is_differential: bool) -> Kind:
        """Return the kind of the plants that ship."""
        if is_differential:
            header = CampaignHeader(
                schema=4, name="free", vehicle_name="robot", front_axle_m=0.0, rear_axle_m=0.0, mocap_rate_hz=100.0,
                channels=Channels.alike("si"), prediction_horizon_s=2.0, prediction_stride_s=1.0,
                kinematics="differential",
            )  # fmt: skip
            return cls(header, 0.0, 0.5, 1.0)
        header = CampaignHeader(
            schema=4, name="free", vehicle_name="car", front_axle_m=0.1, rear_axle_m=0.1, mocap_rate_hz=100.0,
            channels=Channels.alike("us"), prediction_horizon_s=2.0, prediction_stride_s=1.0,
        )  # fmt: skip
        return cls(header, 1500.0, 350.0, 350.0)


def steps(seconds: float, size: float, every_s: float, rng: np.random.Generator) -> np.ndarray:
    """Return a command for each `STEPS_S`: random steps up to `size`."""
    count, held = round(seconds / STEPS_S), max(1, round(every_s / STEPS_S))
    return np.repeat(rng.uniform(-size, size, count // held + 1), held)[:count]


def by_hand(seconds: float, size: float, every_s: float, rng: np.random.Generator) -> np.ndarray:
    """Return a command for each `BY_HAND_S`: a joystick on its way to random places up to `size`."""
    ratio = round(STEPS_S / BY_HAND_S)
    to = np.repeat(steps(seconds, size, every_s, rng), ratio)
    kept = math.exp(-BY_HAND_S / JOYSTICK_S)
    places = lfilter([1.0 - kept], [1.0, -kept], to)
    return np.round(places / size * JOYSTICK_LEVELS) / JOYSTICK_LEVELS * size


def recorded(
    plant: Plant, kind: Kind, minutes: float, rate_hz: float, rng: np.random.Generator, *, hand: bool = False
) -> Part:
    """Drive `plant` in `SESSIONS` sessions, by `hand` or by steps; return what a camera sees of it."""
    seconds, runs = 60.0 * minutes / SESSIONS, []
    driver, interval_s = (by_hand, BY_HAND_S) if hand else (steps, STEPS_S)
    has_rear_axle = not kind.header.geometry.is_differential
    for session in range(SESSIONS):
        drive = kind.neutral + driver(seconds, kind.drive, 1.7, rng)
        front = kind.neutral + driver(seconds, kind.steering, 1.1, rng)
        rear = kind.neutral + has_rear_axle * driver(seconds, kind.steering, 1.9, rng)
        plant.reset((0.0, 0.0, 0.0), seed=session)
        frame_s = np.arange(0.0, seconds - 1e-9, 1.0 / rate_hz)
        own = np.minimum((frame_s / interval_s + 1e-9).astype(int), len(drive) - 1)
        poses = np.array([plant.advance(drive[k], front[k], rear[k], 1.0 / rate_hz) for k in own])
        poses += rng.normal(size=poses.shape) * [NOISE_M, NOISE_M, NOISE_RAD]
        yes, nan = np.ones(len(frame_s), dtype=np.bool_), np.full(len(frame_s), np.nan)
        frames = Frames(frame_s + 1.0 / rate_hz, *poses.T, yes, np.arange(len(frame_s)), nan, nan)
        commands = Commands(interval_s * np.arange(len(drive)), drive, front, rear)
        runs.append(
            Run(f"{session}-0", "free", "", "", 0, NO_TARGET, 3600.0 * session, "ok", "", commands, frames,
                session=f"day {session}")
        )  # fmt: skip
    return Part(kind.header, runs)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=2, help="vehicles drawn at random of each kind (default 2)")
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--rate", type=float, default=100.0, help="frames per second (default 100)")
    wanted = parser.parse_args(arguments)
    print(f"{'vehicle':24s} {'frames':>7s} {'ours':>8s}  {'bound':>7s}  met?  yardstick  answer")
    for is_differential in (False, True):
        kind = Kind.of(is_differential=is_differential)
        for name, plant, number, hand in vehicles(wanted.seeds, is_differential=is_differential):
            rng = np.random.default_rng([0xF4EE, number])
            _print_row(name, recorded(plant, kind, wanted.minutes, wanted.rate, rng, hand=hand))


def vehicles(seeds: int, *, is_differential: bool) -> Iterator[tuple[str, Plant, int, bool]]:
    """Yield name, plant, number of the drive, and whether it is by hand: as they ship, and `seeds` drawn at random."""
    shipped, drawn = (differential_plant, random_differential_plant) if is_differential else (make_plant, random_plant)
    name = "differential" if is_differential else "two axles"
    yield name, shipped(0), 0, False
    yield f"{name}, by hand", shipped(0), 0, True
    for seed in range(seeds):
        yield f"{name}, drawn {seed}", drawn(seed), seed + 1, False


def _print_row(name: str, campaign: Part) -> None:
    diagnose(campaign)  # compiles
    before, began = yardstick(), time.process_time()
    found = diagnose(campaign)
    taken = time.process_time() - began
    error = found.held_out.errors["position_rms_mm"]
    row = f"{name:24s} {sum(len(run.frames) for run in campaign):7d} {taken:6.1f} s  ≤ {BOUND_S:2.0f} s"
    answer = f"{found.verdict} {' '.join(effect.name for effect in found.effects)}"
    errors = f"{error['before']:.0f} → {error['after']:.0f} mm (noise {error['floor']:.1f})"
    met = "yes" if taken <= BOUND_S else "no"
    print(f"{row}  {met:4s}  {0.5 * (before + yardstick()):7.2f} s  {answer}; {errors}", flush=True)


if __name__ == "__main__":
    main()
