"""Simulate a model vehicle with two steered axles under motion capture and write campaign directories.

The vehicle is one state vector: the angles of both servos, the wheel speed, the pose, and the memories of the causes.
Its derivative is one function, integrated by the classical Runge-Kutta scheme for all runs of a campaign at once.
A cause may change commands, aims, rates, wheels, body, floor or camera. The order of the classes is the order of
action.
"""

from __future__ import annotations

import argparse
import json
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Array = NDArray[np.float64]
Leg = tuple[float, float, float, float]  # duration in s, then drive, front and rear as shares −1…1
STEP_S = 0.001
ACTUATOR_S = 0.005  # servos and motor without a cause: far below the interval of two frames
NEUTRAL_US = 1500.0
REST_S = (0.5, 1.0)
RETURN_S = 0.6  # from the stop to the steering's return to neutral
FLOOR_M = 3.8
FRONT, REAR, SPEED, X, Y, HEADING, MEMORY = range(7)
DEGREE = float(np.pi / 180)


def generator(*keys: int | str) -> np.random.Generator:
    """A stream of random numbers of its own for these keys."""
    return np.random.default_rng([key if isinstance(key, int) else zlib.crc32(key.encode()) for key in keys])


# --- the vehicle ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Vehicle:
    """All that is a vehicle's own: dimensions, static curves, the camera's rate and noise, repeatability."""

    front_m: float
    rear_m: float
    header_m: tuple[float, float]
    sign: float
    span_us: float
    bends: tuple[tuple[float, float, float, float], ...]  # for each axle: greatest angle, quadratic, cubic, zero
    drive_us: float
    drive_kind: str
    drive_shape: tuple[float, float]
    top_mps: tuple[float, float]
    rate_hz: float
    noise: tuple[float, float]
    scatter: tuple[float, float]

    @classmethod
    def draw(cls, number: int) -> Vehicle:
        """The vehicle with this number."""
        r = generator("vehicle", number)
        base, share = r.uniform(0.6, 0.7) * r.uniform(0.2, 0.6), r.uniform(0.42, 0.58)
        front, rear = base * share, base * (1 - share)
        most = r.uniform(35, 45)
        bends = tuple(
            (
                most * r.uniform(0.96, 1.0) * DEGREE,
                r.uniform(-0.06, 0.06),
                r.uniform(-0.15, 0.2),
                r.uniform(-0.025, 0.025),
            )
            for _ in range(2)
        )
        top = r.uniform(0.3, 0.9)
        kind = str(r.choice(["linear", "cubic", "s-shaped"]))
        shape = r.uniform(0.3, 0.8) if kind == "cubic" else r.uniform(0.8, 1.6)
        return cls(
            front_m=front,
            rear_m=rear,
            header_m=(round(front + r.uniform(-0.0015, 0.0015), 4), round(rear + r.uniform(-0.0015, 0.0015), 4)),
            sign=float(r.choice([-1.0, 1.0])),
            span_us=float(round(r.uniform(320, 450))),
            bends=bends,
            drive_us=float(round(r.uniform(300, 450))),
            drive_kind=kind,
            drive_shape=(shape, shape * r.uniform(0.9, 1.1)),
            top_mps=(top, top * r.uniform(0.92, 1.0)),
            rate_hz=float(round(r.uniform(60, 150))),
            noise=(r.uniform(0.0002, 0.0005), r.uniform(0.1, 0.3) * DEGREE),
            scatter=(r.uniform(0.02, 0.04) * DEGREE * base / 0.3, r.uniform(0.001, 0.002)),
        )

    @property
    def base_m(self) -> float:
        """The wheelbase."""
        return self.front_m + self.rear_m

    def angle(self, pulse: Array, axle: int) -> Array:
        """The servo's static curve."""
        most, square, cube, zero = self.bends[axle]
        share = self.sign * (pulse - NEUTRAL_US) / self.span_us
        return most * (share + square * (share**2 - 1) * share**2 + cube * (share**3 - share) * 0.5 + zero)

    def speed(self, pulse: Array) -> Array:
        """The drive's static curve."""
        share = (pulse - NEUTRAL_US) / self.drive_us
        shape = np.where(share < 0, self.drive_shape[1], self.drive_shape[0])
        top = np.where(share < 0, self.top_mps[1], self.top_mps[0])
        if self.drive_kind == "linear":
            return np.asarray(top * share)
        if self.drive_kind == "cubic":
            return np.asarray(top * (share + shape * share**3) / (1 + shape))
        return np.asarray(top * np.tanh(shape * share) / np.tanh(shape))

    def pulses(self, drive: float, front: float, rear: float) -> tuple[float, float, float]:
        """The commands for shares of the range: forward and left are positive."""
        steer = self.sign * self.span_us
        return (
            float(round(NEUTRAL_US + self.drive_us * drive)),
            float(round(NEUTRAL_US + steer * front)),
            float(round(NEUTRAL_US + steer * rear)),
        )

    def twist(self, speed: Array, front: Array, rear: Array, ratio: float = 1.0) -> tuple[Array, Array, Array]:
        """Speed of the centroid, sideslip angle and curvature; the rear wheels run at `ratio` times the front's.

        The speed of the centroid is the mean of both axles' speeds along the vehicle, and `speed` is their mean.
        """
        slip = np.arctan((self.front_m * np.tan(rear) + self.rear_m * np.tan(front)) / self.base_m)
        mean = (np.cos(front) + ratio * np.cos(rear)) / (1 + ratio)
        return speed * mean / np.cos(slip), slip, np.cos(slip) * (np.tan(front) - np.tan(rear)) / self.base_m


def ideal_path(vehicle: Vehicle, legs: Sequence[Leg], points: int = 12) -> Array:
    """Pose at `points` moments of each leg, from the origin, by closed arcs: for placing runs and checking."""
    pose, path = np.zeros(3), [np.zeros(3)]
    for duration, *shares in legs:
        drive, front, rear = (np.array(pulse) for pulse in vehicle.pulses(*shares))
        v, slip, bend = vehicle.twist(vehicle.speed(drive), vehicle.angle(front, 0), vehicle.angle(rear, 1))
        for part in np.linspace(0, 1, points + 1)[1:]:
            length, turn = float(v) * duration * part, float(v * bend) * duration * part
            chord = length * np.sinc(turn / 2 / np.pi)
            course = pose[2] + float(slip) + turn / 2
            path.append(pose + np.array([chord * np.cos(course), chord * np.sin(course), turn]))
        pose = path[-1]
    return np.array(path)


# --- the campaign's plan ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Manoeuvre:
    """A sequence of commands that is repeated."""

    name: str
    experiment: str
    legs: tuple[Leg, ...]
    repeats: int


@dataclass
class Planner:
    """Chooses the manoeuvres that a careful experimenter would drive."""

    vehicle: Vehicle
    rng: np.random.Generator
    found: list[Manoeuvre] = field(default_factory=list)

    def leg(self, metres: float, drive: float, front: float = 0.0, rear: float = 0.0) -> Leg:
        """A leg of about this length."""
        speed = abs(float(self.vehicle.speed(np.array(self.vehicle.pulses(drive, 0, 0)[0]))))
        return round(metres / speed, 2), drive, front, rear

    def add(self, name: str, experiment: str, legs: Iterable[Leg], repeats: int) -> None:
        """Take up a manoeuvre; its time is stretched or cut to the duration that runs may have."""
        parts = list(legs)
        total = sum(leg[0] for leg in parts)
        factor = min(max(total, 1.6), 6.6) / total
        self.found.append(
            Manoeuvre(name, experiment, tuple((round(leg[0] * factor, 2), *leg[1:]) for leg in parts), repeats)
        )

    def arcs(self) -> None:
        """Constant arcs with each pattern of both axles."""
        patterns = (
            ("front", "steering_front", 1, 0, 4),
            ("rear", "steering_rear", 0, 1, 3),
            ("opposite", "steering_opposite", 1, -1, 3),
            ("alike", "free", 1, 1, 3),
        )
        for name, experiment, front, rear, repeats in patterns:
            for size, way in ((0.4, 1), (-0.4, 1), (0.85, 1), (-0.85, 1), (0.65, -1), (-0.65, -1)):
                share, drive = size * self.rng.uniform(0.9, 1.1), way * self.rng.uniform(0.5, 0.85)
                legs = [self.leg(2.6, drive, share * front, share * rear)]
                self.add(f"{name} {size:+} {'forward' if way > 0 else 'backward'}", experiment, legs, repeats)

    def straights(self) -> None:
        """Straights at five speeds each way."""
        for way in (1, -1):
            for drive in (0.25, 0.42, 0.6, 0.8, 1.0):
                self.add(f"straight {way * drive:+}", "drive", [self.leg(2.8, way * drive)], 3)

    def trajectories(self) -> None:
        """Steering that changes while driving."""
        drive, a, b = self.rng.uniform(0.55, 0.85), self.rng.uniform(0.5, 0.7), self.rng.uniform(0.3, 0.5)
        shapes = {
            "s-curve left": [(1.3, a, 0.0), (1.3, -a, 0.0)],
            "s-curve right": [(1.3, -a, a), (1.3, a, -a)],
            "slalom front": [(0.4, b, 0.0), (0.7, -b, 0.0), (0.7, b, 0.0), (0.7, -b, 0.0)],
            "slalom rear": [(0.4, 0.0, -b), (0.7, 0.0, b), (0.7, 0.0, -b), (0.7, 0.0, b)],
            "lane change": [(0.6, 0.0, 0.0), (0.6, a, -b), (0.6, -a, b), (0.6, 0.0, 0.0)],
            "lane change crab": [(0.6, 0.0, 0.0), (1.2, b, b), (0.8, 0.0, 0.0)],
        }
        for name, parts in shapes.items():
            self.add(name, "trajectory", [self.leg(metres, drive, f, r) for metres, f, r in parts], 4)
        back = [self.leg(metres, -0.7, f, r) for metres, f, r in shapes["slalom front"]]
        self.add("slalom backward", "trajectory", back, 3)

    def speeds(self) -> None:
        """Reversals, stops, steps of speed, and the same arc fast and slow."""
        halt: Leg = (0.6, 0.0, 0.0, 0.0)
        self.add("reversal straight", "step", [self.leg(1.6, 0.7), self.leg(0.9, -0.7)], 3)
        self.add("reversal arc", "trajectory", [self.leg(1.5, 0.7, 0.6), self.leg(1.2, -0.6, -0.5)], 3)
        self.add("reversal start backward", "step", [self.leg(1.3, -0.6, 0.0, 0.4), self.leg(1.3, 0.8, 0.0, 0.4)], 3)
        self.add("stop straight", "step", [self.leg(1.1, 0.65), halt, self.leg(1.1, 0.65)], 3)
        turn = (0.5, 0.0, 0.5, -0.3)
        self.add("stop arc", "step", [self.leg(1.0, 0.8, 0.5, -0.3), turn, self.leg(1.0, 0.8, 0.5, -0.3)], 3)
        self.add("speed up", "step", [self.leg(0.9, 0.4), self.leg(1.4, 0.95)], 3)
        self.add("slow down", "step", [self.leg(1.4, 0.95), self.leg(0.9, 0.4)], 3)
        steps = [self.leg(0.8, -0.5, -0.4), self.leg(1.0, -0.9, -0.4), self.leg(0.6, -0.4, -0.4)]
        self.add("steps backward", "step", steps, 3)
        for name, drive in (("fast", 1.0), ("slow", 0.38)):
            self.add(f"arc front {name}", "steering_front", [self.leg(2.4, drive, 0.55)], 3)
            self.add(f"arc opposite {name}", "steering_opposite", [self.leg(2.4, drive, -0.5, 0.5)], 3)

    def all(self) -> list[Manoeuvre]:
        """Every manoeuvre of the campaign."""
        self.arcs()
        self.straights()
        self.trajectories()
        self.speeds()
        return self.found


@dataclass(frozen=True)
class Drive:
    """A run: a manoeuvre and its number among the repeats."""

    manoeuvre: Manoeuvre
    repeat: int


@dataclass
class World:
    """The runs of a campaign, with what happens at each of them whatever the cause."""

    vehicle: Vehicle
    runs: list[Drive]
    started: Array
    poses: Array  # start poses, 3 × runs
    scatter: Array  # offsets of both axles and the scale of speed, 3 × runs
    session: Array
    total_s: float

    @classmethod
    def draw(cls, vehicle: Vehicle, number: int, seed: int) -> World:
        """Draw the order, times and start poses."""
        rng = generator("plan", number, seed)
        runs = shuffled(Planner(vehicle, rng).all(), rng)
        started = times(runs, rng)
        poses = np.array([place(vehicle, run.manoeuvre.legs, rng) for run in runs]).T
        spread = np.array([vehicle.scatter[0], vehicle.scatter[0], vehicle.scatter[1]])
        scatter = rng.normal(size=(3, len(runs))) * spread[:, None] + np.array([[0.0], [0.0], [1.0]])
        return cls(vehicle, runs, started, poses, scatter, np.zeros(len(runs)), float(started[-1]) + 10.0)

    def rows(self, run: int) -> list[tuple[float, float, float, float]]:
        """Time and commands of a run, with its stop and the return of the steering."""
        found, t = [], 0.0
        legs = self.runs[run].manoeuvre.legs
        for duration, *shares in legs:
            found.append((round(t, 2), *self.vehicle.pulses(*shares)))
            t += duration
        found.append((round(t, 2), *self.vehicle.pulses(0.0, *legs[-1][2:])))
        return [*found, (round(t + RETURN_S, 2), NEUTRAL_US, NEUTRAL_US, NEUTRAL_US)]

    def held(self) -> Array:
        """The commands at each step of integration, steps × 3 × runs."""
        tables = [np.array(self.rows(run)) for run in range(len(self.runs))]
        steps = round((max(table[-1, 0] for table in tables) + REST_S[1] + 0.6) / STEP_S)
        t = (np.arange(steps) + 0.5) * STEP_S
        return np.stack([tab[np.searchsorted(tab[:, 0], t, side="right") - 1, 1:] for tab in tables], axis=2)

    def first_drive(self) -> Array:
        """The share of speed in each run's first leg: forward is positive."""
        return np.array([run.manoeuvre.legs[0][1] for run in self.runs])

    def session_hours(self, hours: Array) -> Array:
        """Hours since the battery was charged."""
        return hours - self.session


def shuffled(manoeuvres: Sequence[Manoeuvre], rng: np.random.Generator) -> list[Drive]:
    """Spread the repeats of each manoeuvre, but let some follow each other directly."""
    keyed: list[tuple[float, Drive]] = []
    for manoeuvre in manoeuvres:
        keys = (rng.permutation(manoeuvre.repeats) + rng.uniform(size=manoeuvre.repeats)) / manoeuvre.repeats
        if rng.uniform() < 0.4:
            keys[1] = keys[0] + 1e-9
        keyed += [(float(key), Drive(manoeuvre, 0)) for key in keys]
    counts: dict[str, int] = {}
    found = []
    for _, drive in sorted(keyed, key=lambda pair: pair[0]):
        name = drive.manoeuvre.name
        found.append(Drive(drive.manoeuvre, counts.get(name, 0)))
        counts[name] = counts.get(name, 0) + 1
    return found


def times(runs: Sequence[Drive], rng: np.random.Generator) -> Array:
    """When each run starts: 1.5 to 2.5 hours in all, pairs shortly after each other."""
    least = np.array([0.0] + [sum(leg[0] for leg in run.manoeuvre.legs) + 9.0 for run in runs[:-1]])
    pause = rng.gamma(2.0, 1.0, len(runs))
    pause[0] = 3.0
    for run in range(1, len(runs)):
        if runs[run].manoeuvre is runs[run - 1].manoeuvre:
            pause[run] *= 0.1
    rest = rng.uniform(1.5, 2.5) * 3600 - least.sum()
    return np.asarray(np.round(np.cumsum(least + pause * rest / pause.sum()), 2))


def place(vehicle: Vehicle, legs: Sequence[Leg], rng: np.random.Generator) -> Array:
    """A random start pose from which the run stays on the floor."""
    path = ideal_path(vehicle, legs)
    for _ in range(60):
        turn = rng.uniform(-np.pi, np.pi)
        x = path[:, 0] * np.cos(turn) - path[:, 1] * np.sin(turn)
        y = path[:, 0] * np.sin(turn) + path[:, 1] * np.cos(turn)
        room = FLOOR_M - np.array([np.ptp(x), np.ptp(y)])
        if room.min() > 0:
            break
    low = -FLOOR_M / 2 - np.array([x.min(), y.min()]) + np.minimum(room, 0) / 2
    return np.append(low + rng.uniform(size=2) * np.maximum(room, 0), turn)


# --- integration ------------------------------------------------------------------------------------------------------


class Moment:
    """All quantities of all runs at one evaluation of the derivative; the causes change them in turn."""

    front_aim: Array
    rear_aim: Array
    speed_aim: Array
    front: Array
    rear: Array
    speed: Array
    ratio: float = 1.0
    slip: Array
    curvature: Array
    lateral: Array
    spin: Array
    drift_x: Array
    drift_y: Array

    def __init__(self, world: World, t: float, state: Array) -> None:
        """Begin with nothing but the state."""
        self.world, self.vehicle, self.t, self.state = world, world.vehicle, t, state
        self.rate = np.zeros_like(state)
        self.hours = (world.started + t) / 3600
        self.evening = (world.started + t) / world.total_s
        self.steering_s: Array | float = 0.0
        self.speeding_s: Array | float = 0.0
        zeros = np.zeros(state.shape[1])
        self.lateral, self.spin, self.drift_x, self.drift_y = zeros, zeros, zeros, zeros

    @property
    def moving(self) -> Array:
        """1 while the vehicle moves, 0 at rest, with a short transition."""
        return np.asarray(np.minimum(np.abs(self.state[SPEED]) / 0.02, 1.0))

    @property
    def course(self) -> Array:
        """Direction of travel on the floor."""
        return np.asarray(self.state[HEADING] + self.slip + np.where(self.speed < 0, np.pi, 0.0))


class Past:
    """A ring buffer of the commands of the last steps."""

    def __init__(self, first: Array, longest_s: float) -> None:
        """Fill the buffer with the commands before the run."""
        self.ring = np.repeat(first[None], int(longest_s / STEP_S) + 3, axis=0)
        self.step = 0

    def push(self, command: Array) -> None:
        """Store the command of this step."""
        self.step += 1
        self.ring[self.step % len(self.ring)] = command

    def at(self, delay_s: float) -> Array:
        """The command this long ago."""
        whole, part = divmod(delay_s / STEP_S, 1.0)
        new, old = (self.ring[(self.step - int(whole) - k) % len(self.ring)] for k in (0, 1))
        return np.asarray(new + part * (old - new))


@dataclass
class Frames:
    """What the camera sees of one run."""

    evening: Array
    x: Array
    y: Array
    heading: Array


class Simulation:
    """The vehicle with its causes in all runs of a campaign."""

    def __init__(self, world: World, causes: Sequence[Cause]) -> None:
        """Give each cause its part of the state."""
        self.world, self.causes = world, causes
        self.size = MEMORY
        for cause in causes:
            cause.slot = slice(self.size, self.size + cause.memory)
            self.size += cause.memory

    def aim(self, m: Moment, command: Array) -> None:
        """Static curves of servos and drive."""
        vehicle, scatter = self.world.vehicle, self.world.scatter
        m.speed_aim = vehicle.speed(command[0]) * scatter[2]
        m.front_aim = vehicle.angle(command[1], 0) + scatter[0]
        m.rear_aim = vehicle.angle(command[2], 1) + scatter[1]
        for cause in self.causes:
            cause.aims(m)

    def follow(self, m: Moment) -> None:
        """Servos and motor follow their aims."""
        steering, speeding = np.maximum(m.steering_s, ACTUATOR_S), np.maximum(m.speeding_s, ACTUATOR_S)
        m.rate[FRONT] = (m.front_aim - m.state[FRONT]) / steering
        m.rate[REAR] = (m.rear_aim - m.state[REAR]) / steering
        m.rate[SPEED] = (m.speed_aim - m.state[SPEED]) / speeding
        for cause in self.causes:
            cause.rates(m)

    def roll(self, m: Moment) -> None:
        """Wheels, then the body."""
        m.front, m.rear, m.speed = m.state[FRONT], m.state[REAR], m.state[SPEED]
        for cause in self.causes:
            cause.wheels(m)
        m.speed, m.slip, m.curvature = m.vehicle.twist(m.speed, m.front, m.rear, m.ratio)
        for cause in self.causes:
            cause.body(m)

    def travel(self, m: Moment) -> None:
        """Motion on the floor."""
        for cause in self.causes:
            cause.floor(m)
        heading = m.state[HEADING]
        m.rate[X] = m.speed * np.cos(heading + m.slip) - m.lateral * np.sin(heading) + m.drift_x
        m.rate[Y] = m.speed * np.sin(heading + m.slip) + m.lateral * np.cos(heading) + m.drift_y
        m.rate[HEADING] = m.speed * m.curvature + m.spin

    def derivative(self, t: float, state: Array, command: Array) -> Array:
        """The derivative of the whole state."""
        m = Moment(self.world, t, state)
        self.aim(m, command)
        self.follow(m)
        self.roll(m)
        self.travel(m)
        return m.rate

    def start(self, command: Array) -> Array:
        """The state at rest before the first command."""
        state = np.zeros((self.size, len(self.world.runs)))
        state[X : HEADING + 1] = self.world.poses
        m = Moment(self.world, 0.0, state)
        self.aim(m, command)
        state[FRONT], state[REAR] = m.front_aim, m.rear_aim
        for cause in self.causes:
            if cause.memory:
                state[cause.slot] = cause.initial(self.world, state)
        return state

    def run(self) -> tuple[Array, Array]:
        """Poses and their derivatives at each step, both steps × 3 × runs."""
        held, h = self.world.held(), STEP_S
        neutral = np.full(held.shape[1:], NEUTRAL_US)
        past = Past(neutral, 2.0)
        state = self.start(neutral)
        poses, rates = np.empty_like(held), np.empty_like(held)
        for n, command in enumerate(held):
            past.push(command)
            for cause in self.causes:
                command = cause.commands(past, command)
            k1 = self.derivative(n * h, state, command)
            k2 = self.derivative((n + 0.5) * h, state + (h / 2) * k1, command)
            k3 = self.derivative((n + 0.5) * h, state + (h / 2) * k2, command)
            k4 = self.derivative((n + 1) * h, state + h * k3, command)
            poses[n], rates[n] = state[X : HEADING + 1], k1[X : HEADING + 1]
            state = state + (h / 6) * (k1 + 2 * (k2 + k3) + k4)
        return poses, rates


def interpolate(poses: Array, rates: Array, t: Array) -> Array:
    """Poses of one run at any times, by cubic polynomials; at rest before the first step."""
    place = np.clip(t / STEP_S, 0.0, len(poses) - 1.001)
    n = place.astype(int)
    s = (place - n)[:, None]
    a, b, da, db = poses[n], poses[n + 1], rates[n] * STEP_S, rates[n + 1] * STEP_S
    rise = b - a
    return np.asarray(a + s * (da + s * (3 * rise - 2 * da - db + s * (da + db - 2 * rise))))


# --- causes -----------------------------------------------------------------------------------------------------------


class Cause:
    """A physical cause. Its size is drawn when it is made; each method acts at one place of the chain."""

    registry: ClassVar[dict[str, type[Cause]]] = {}
    name: ClassVar[str]
    group: ClassVar[str]
    memory: int = 0
    slot: slice

    def __init_subclass__(cls, name: str, group: str) -> None:
        """Enter the class in the registry."""
        cls.name, cls.group = name, group
        Cause.registry[name] = cls

    def __init__(self, world: World, rng: np.random.Generator, scale: float) -> None:
        """Draw the sizes."""
        self.rng, self.scale, self.values = rng, scale, dict[str, float | str]()
        self.draw(world)

    def size(self, key: str, low: float, high: float, signed: bool = False) -> float:
        """Draw a size, times the scale."""
        value = self.pick(key, low, high) * self.scale
        value *= self.rng.choice([-1.0, 1.0]) if signed else 1.0
        self.values[key] = float(value)
        return float(value)

    def pick(self, key: str, low: float, high: float) -> float:
        """Draw a property that has nothing to do with strength."""
        self.values[key] = float(self.rng.uniform(low, high))
        return float(self.values[key])

    def note(self, key: str, value: float) -> float:
        """Record a value that follows from others."""
        self.values[key] = float(value)
        return float(value)

    def draw(self, world: World) -> None:
        """Draw all sizes."""

    def initial(self, world: World, state: Array) -> Array:
        """The memory before the first command."""
        return np.zeros((self.memory, state.shape[1]))

    def commands(self, past: Past, command: Array) -> Array:
        """Change the commands on their way."""
        return command

    def aims(self, m: Moment) -> None:
        """Change what servos and drive aim at, or their time constants."""

    def rates(self, m: Moment) -> None:
        """Change how servos and drive follow."""

    def wheels(self, m: Moment) -> None:
        """Change angles and speed of the wheels."""

    def body(self, m: Moment) -> None:
        """Change the body's speed, curvature, sideways motion and spin."""

    def floor(self, m: Moment) -> None:
        """Add motion of the vehicle against the floor."""

    def clock(self, evening: float) -> float:
        """How much older the poses are than their stamps."""
        return 0.0

    def camera(self, frames: Frames) -> None:
        """Change what is measured."""


class ActuationDelay(Cause, name="actuation_delay", group="inside"):
    """Every command takes effect late."""

    def draw(self, world: World) -> None:
        self.delay = self.size("delay_s", 0.05, 0.15)

    def commands(self, past: Past, command: Array) -> Array:
        return past.at(self.delay)


class GainFades(Cause, name="gain_fades", group="time"):
    """The gain of both servos falls linearly over the campaign."""

    def draw(self, world: World) -> None:
        self.share = self.size("loss_share", 0.05, 0.10)

    def aims(self, m: Moment) -> None:
        m.front_aim = m.front_aim * (1 - self.share * m.evening)
        m.rear_aim = m.rear_aim * (1 - self.share * m.evening)


class TrimStep(Cause, name="trim_step", group="time"):
    """The neutral angle of one axle steps at some time."""

    def draw(self, world: World) -> None:
        self.step = self.size("step_deg", 1.0, 2.0, signed=True) * DEGREE
        self.moment = self.pick("at_share_of_campaign", 0.3, 0.7)
        self.at_front = self.rng.uniform() < 0.5
        self.values["axle"] = "front" if self.at_front else "rear"

    def aims(self, m: Moment) -> None:
        step = np.where(m.evening > self.moment, self.step, 0.0)
        if self.at_front:
            m.front_aim = m.front_aim + step
        else:
            m.rear_aim = m.rear_aim + step


class ServoSupplyDip(Cause, name="servo_supply_dip", group="outside"):
    """Steering angles shrink while the vehicle accelerates: the supply recovers slowly after a rise of speed."""

    memory = 1

    def draw(self, world: World) -> None:
        self.share = self.size("share_at_top_speed", 0.25, 0.45)
        self.recovery = self.pick("recovery_s", 0.3, 0.6)

    def aims(self, m: Moment) -> None:
        known, speed = m.state[self.slot][0], np.abs(m.state[SPEED])
        m.rate[self.slot] = (speed - known) / self.recovery
        dip = 1 - self.share * np.clip((speed - known) / m.vehicle.top_mps[0], 0, 1)
        m.front_aim, m.rear_aim = m.front_aim * dip, m.rear_aim * dip


class BatteryDroop(Cause, name="battery_droop", group="inside"):
    """Speed falls linearly with the hours since the session began."""

    def draw(self, world: World) -> None:
        self.slope = self.size("loss_per_h", 0.05, 0.12)

    def aims(self, m: Moment) -> None:
        m.speed_aim = m.speed_aim * (1 - self.slope * m.world.session_hours(m.hours))


class BatteryChange(Cause, name="battery_change", group="time"):
    """Speed falls linearly, and jumps back when the battery is changed; a new session begins then."""

    def draw(self, world: World) -> None:
        self.slope = self.size("loss_per_h", 0.07, 0.13)
        self.moment = self.pick("at_share_of_campaign", 0.4, 0.65)
        change = world.started[world.started > self.moment * world.total_s][0]
        world.session = np.where(world.started >= change, change / 3600, world.session)

    def aims(self, m: Moment) -> None:
        m.speed_aim = m.speed_aim * (1 - self.slope * m.world.session_hours(m.hours))


class SlowEvening(Cause, name="slow_evening", group="time"):
    """Speed falls exponentially over the campaign."""

    def draw(self, world: World) -> None:
        self.share = self.size("loss_share", 0.05, 0.10)
        self.decay = self.pick("time_constant_h", 0.4, 1.0)

    def aims(self, m: Moment) -> None:
        whole = 1 - np.exp(-m.world.total_s / 3600 / self.decay)
        m.speed_aim = m.speed_aim * (1 - self.share * (1 - np.exp(-m.hours / self.decay)) / whole)


class WarmUp(Cause, name="warm_up", group="time"):
    """A lack of speed, or a lag of the steering, that decays exponentially with the campaign's time."""

    def draw(self, world: World) -> None:
        self.decay = self.pick("time_constant_h", 0.3, 0.7)
        self.of_speed = self.rng.uniform() < 0.5
        self.values["of"] = "speed" if self.of_speed else "steering lag"
        self.first = self.size("loss_share", 0.07, 0.13) if self.of_speed else self.size("lag_s", 0.25, 0.4)

    def aims(self, m: Moment) -> None:
        left = self.first * np.exp(-m.hours / self.decay)
        if self.of_speed:
            m.speed_aim = m.speed_aim * (1 - left)
        else:
            m.steering_s = m.steering_s + left


class SteeringLag(Cause, name="steering_lag", group="inside"):
    """Each axle follows its commanded angle as a first-order lag."""

    def draw(self, world: World) -> None:
        self.lag = self.size("lag_s", 0.1, 0.3)

    def aims(self, m: Moment) -> None:
        m.steering_s = m.steering_s + self.lag


class SpeedLag(Cause, name="speed_lag", group="inside"):
    """Speed follows its command as a first-order lag, with another time constant when braking."""

    def draw(self, world: World) -> None:
        self.up = self.size("accelerating_s", 0.15, 0.4)
        self.down = self.size("braking_s", 0.1, 0.3)

    def aims(self, m: Moment) -> None:
        speed = m.state[SPEED]
        braking = (np.abs(m.speed_aim) < np.abs(speed)) | (m.speed_aim * speed < 0)
        m.speeding_s = m.speeding_s + np.where(braking, self.down, self.up)


class RunOut(Cause, name="run_out", group="outside"):
    """After the end of a drive command the vehicle coasts with a constant deceleration."""

    def draw(self, world: World) -> None:
        speed = 0.7 * world.vehicle.top_mps[0]
        metres = self.size("coasting_at_70_percent_m", 0.04, 0.07)
        self.brake = self.note("deceleration_mps2", speed**2 / 2 / max(metres, 1e-4))

    def rates(self, m: Moment) -> None:
        limit = np.where(np.abs(m.speed_aim) < 0.004, self.brake, np.inf)
        m.rate[SPEED] = np.clip(m.rate[SPEED], -limit, limit)


class SteeringRateLimit(Cause, name="steering_rate_limit", group="inside"):
    """The angular rate of the axles is limited; a larger scale is a lower limit."""

    def draw(self, world: World) -> None:
        self.limit = self.note("limit_radps", self.rng.uniform(0.6, 1.5) / max(self.scale, 1e-3))

    def rates(self, m: Moment) -> None:
        np.clip(m.rate[: REAR + 1], -self.limit, self.limit, out=m.rate[: REAR + 1])


class SteeringHysteresis(Cause, name="steering_hysteresis", group="outside"):
    """Friction with memory: the angle lags behind by an amount that saturates over some degrees of motion."""

    memory = 2

    def draw(self, world: World) -> None:
        self.height = self.size("height_deg_at_wheelbase_0.3_m", 0.7, 1.3) * DEGREE * world.vehicle.base_m / 0.3
        self.reach = self.pick("reach_deg", 7.0, 12.0) * DEGREE

    def wheels(self, m: Moment) -> None:
        motion, memory = m.rate[: REAR + 1], m.state[self.slot]
        m.rate[self.slot] = (motion - np.abs(motion) * memory) / self.reach
        m.front, m.rear = m.front - self.height * memory[0], m.rear - self.height * memory[1]


class SteeringBacklash(Cause, name="steering_backlash", group="inside"):
    """Play between servo and axle; each run begins in the middle of the play."""

    memory = 2

    def draw(self, world: World) -> None:
        self.half = self.size("width_deg", 2.0, 5.0) * DEGREE / 2

    def initial(self, world: World, state: Array) -> Array:
        return state[: REAR + 1]

    def wheels(self, m: Moment) -> None:
        axle = m.state[self.slot]
        gap = np.stack([m.front, m.rear]) - axle
        m.rate[self.slot] = (gap - np.clip(gap, -self.half, self.half)) / ACTUATOR_S
        m.front, m.rear = axle[0], axle[1]


class ReverseSteeringGain(Cause, name="reverse_steering_gain", group="inside"):
    """Driving backward, the steering angles are larger or smaller by a share."""

    def draw(self, world: World) -> None:
        self.share = self.size("share", 0.08, 0.2, signed=True)

    def wheels(self, m: Moment) -> None:
        gain = np.where(m.speed < 0, 1 + self.share, 1.0)
        m.front, m.rear = m.front * gain, m.rear * gain


class AxleCoupling(Cause, name="axle_coupling", group="inside"):
    """Each axle takes a share of the other's angle."""

    def draw(self, world: World) -> None:
        self.to_front = self.size("rear_to_front_share", 0.05, 0.12)
        self.to_rear = self.size("front_to_rear_share", 0.05, 0.12)

    def wheels(self, m: Moment) -> None:
        m.front, m.rear = m.front + self.to_front * m.rear, m.rear + self.to_rear * m.front


class CorneringSpeedLoss(Cause, name="cornering_speed_loss", group="inside"):
    """The vehicle loses speed in proportion to the sum of the tangents of both angles."""

    def draw(self, world: World) -> None:
        self.share = self.size("loss_per_tangent", 0.08, 0.2)

    def wheels(self, m: Moment) -> None:
        loss = self.share * (np.abs(np.tan(m.front)) + np.abs(np.tan(m.rear)))
        m.speed = m.speed * np.maximum(1 - loss, 0.05)


class AxleSpeedMismatch(Cause, name="axle_speed_mismatch", group="inside"):
    """The rear wheels turn faster or slower than the front wheels; their mean is as the drive's curve says."""

    def draw(self, world: World) -> None:
        self.share = self.size("rear_faster_share", 0.08, 0.2, signed=True)

    def wheels(self, m: Moment) -> None:
        m.ratio = 1 + self.share


class SlowPatch(Cause, name="slow_patch", group="outside"):
    """A disc of the floor where the vehicle is slower."""

    def draw(self, world: World) -> None:
        self.share = self.size("loss_share", 0.04, 0.07)
        self.radius = self.pick("radius_m", 0.6, 0.9)
        self.x, self.y = self.pick("x_m", -0.7, 0.7), self.pick("y_m", -0.7, 0.7)

    def body(self, m: Moment) -> None:
        away = np.hypot(m.state[X] - self.x, m.state[Y] - self.y)
        m.speed = m.speed * (1 - self.share * np.clip(0.5 + (self.radius - away) / 0.02, 0, 1))


class SpeedByCourse(Cause, name="speed_by_course", group="outside"):
    """Speed depends on the direction of travel on the floor."""

    def draw(self, world: World) -> None:
        self.share = self.size("share", 0.025, 0.045)
        self.along = self.pick("fastest_course_rad", -np.pi, np.pi)

    def body(self, m: Moment) -> None:
        m.speed = m.speed * (1 + self.share * np.cos(m.course - self.along))


class LateralSlip(Cause, name="lateral_slip", group="inside"):
    """Understeer: curvature falls with the square of the speed."""

    def draw(self, world: World) -> None:
        share = self.size("loss_at_top_speed_share", 0.10, 0.25)
        share = min(share, 0.9)
        self.slope = self.note("slope_s2_per_m2", share / (1 - share) / world.vehicle.top_mps[0] ** 2)

    def body(self, m: Moment) -> None:
        m.curvature = m.curvature / (1 + self.slope * m.speed**2)


class SpeedSteeringInteraction(Cause, name="speed_steering_interaction", group="outside"):
    """The turn rate loses a share in proportion to speed times steering angle."""

    def draw(self, world: World) -> None:
        self.share = self.size("loss_at_top_speed_and_one_axle_at_30_deg", 0.05, 0.09)

    def body(self, m: Moment) -> None:
        load = np.abs(m.speed) / m.vehicle.top_mps[0] * (np.abs(m.front) + np.abs(m.rear)) / (30 * DEGREE)
        m.curvature = m.curvature * np.maximum(1 - self.share * load, 0.1)


class WheelDiameterMismatch(Cause, name="wheel_diameter_mismatch", group="inside"):
    """Left and right wheels differ: a constant additional curvature."""

    def draw(self, world: World) -> None:
        self.bend = self.size("curvature_1_per_m", 0.03, 0.1, signed=True)

    def body(self, m: Moment) -> None:
        m.curvature = m.curvature + self.bend


class WheelEccentricity(Cause, name="wheel_eccentricity", group="outside"):
    """Curvature varies periodically with the distance; each run begins at a random angle of the wheel."""

    memory = 1

    def draw(self, world: World) -> None:
        self.wave = 2 * np.pi / self.pick("circumference_m", 0.2, 0.4)
        self.swing = self.size("heading_amplitude_deg", 2.0, 3.5) * DEGREE

    def initial(self, world: World, state: Array) -> Array:
        return self.rng.uniform(0, 2 * np.pi / self.wave, (1, state.shape[1]))

    def body(self, m: Moment) -> None:
        m.rate[self.slot] = m.speed
        m.curvature = m.curvature + self.swing * self.wave * np.cos(self.wave * m.state[self.slot][0])


class StartTwist(Cause, name="start_twist", group="outside"):
    """A kick of the heading in the first 0.3 s of motion of each run that starts forward."""

    memory = 1

    def draw(self, world: World) -> None:
        self.kick = self.size("kick_deg", 1.2, 2.2, signed=True) * DEGREE
        self.forward = world.first_drive() > 0

    def body(self, m: Moment) -> None:
        m.rate[self.slot] = m.moving
        early = self.forward & (m.state[self.slot][0] < 0.3)
        m.spin = m.spin + m.moving * early * self.kick / 0.3


class Seam(Cause, name="seam", group="outside"):
    """Crossing a line on the floor turns the heading, to the same side in both directions."""

    def draw(self, world: World) -> None:
        self.kick = self.size("kick_deg", 2.0, 3.5, signed=True) * DEGREE
        self.normal = self.pick("normal_rad", -np.pi, np.pi)
        self.away = self.pick("distance_from_origin_m", -0.3, 0.3)

    def body(self, m: Moment) -> None:
        width, across = 0.015, np.abs(m.speed * np.cos(m.course - self.normal))
        gap = m.state[X] * np.cos(self.normal) + m.state[Y] * np.sin(self.normal) - self.away
        m.spin = m.spin + self.kick * across * np.exp(-0.5 * (gap / width) ** 2) / (width * np.sqrt(2 * np.pi))


class LateralCreep(Cause, name="lateral_creep", group="outside"):
    """Motion sideways, outward, in proportion to the lateral acceleration."""

    def draw(self, world: World) -> None:
        metres = self.size("creep_share_at_60_percent_speed_and_curvature_1_per_m", 0.025, 0.045)
        self.slope = self.note("creep_s", metres / (0.6 * world.vehicle.top_mps[0]))

    def body(self, m: Moment) -> None:
        m.lateral = m.lateral - self.slope * m.speed**2 * m.curvature


class Gust(Cause, name="gust", group="outside"):
    """A sinusoidal drift towards the vehicle's side while it moves, with a fixed period."""

    def draw(self, world: World) -> None:
        self.peak = self.size("peak_mps", 0.018, 0.030)
        self.period = self.pick("period_s", 9.0, 25.0)
        self.phase = self.pick("phase_rad", -np.pi, np.pi)

    def body(self, m: Moment) -> None:
        wave = np.sin(2 * np.pi * m.hours * 3600 / self.period + self.phase)
        m.lateral = m.lateral + m.moving * self.peak * wave


class FloorTilt(Cause, name="floor_tilt", group="inside"):
    """A moving vehicle drifts in a fixed direction of the floor."""

    def draw(self, world: World) -> None:
        self.drift = self.size("drift_mps", 0.008, 0.020)
        self.along = self.pick("direction_rad", -np.pi, np.pi)

    def strength(self, m: Moment) -> Array:
        """Speed of the drift."""
        return m.moving * self.drift

    def floor(self, m: Moment) -> None:
        drift = self.strength(m)
        m.drift_x = m.drift_x + drift * np.cos(self.along)
        m.drift_y = m.drift_y + drift * np.sin(self.along)


class WindSecondHalf(FloorTilt, name="wind_second_half", group="time"):
    """A drift of moving vehicles in one direction in the second half of the campaign."""

    def strength(self, m: Moment) -> Array:
        return np.where(m.evening > 0.5, m.moving * self.drift, 0.0)


class PullToPoint(Cause, name="pull_to_point", group="outside"):
    """A moving vehicle is drawn slowly towards a point of the room."""

    def draw(self, world: World) -> None:
        self.pull = self.size("pull_mps", 0.006, 0.010)
        self.x, self.y = self.pick("x_m", -1.5, 1.5), self.pick("y_m", -1.5, 1.5)

    def floor(self, m: Moment) -> None:
        dx, dy = self.x - m.state[X], self.y - m.state[Y]
        pull = m.moving * self.pull / np.hypot(np.hypot(dx, dy), 0.1)
        m.drift_x, m.drift_y = m.drift_x + pull * dx, m.drift_y + pull * dy


class MocapLatency(Cause, name="mocap_latency", group="inside"):
    """The pose stamped t was true at t minus the latency."""

    def draw(self, world: World) -> None:
        self.latency = self.size("latency_s", 0.03, 0.08, signed=True)

    def clock(self, evening: float) -> float:
        return self.latency


class DriftingClock(Cause, name="drifting_clock", group="time"):
    """The stamps of the poses drift against the clock of the commands."""

    def draw(self, world: World) -> None:
        self.drift = self.size("drift_over_campaign_s", 0.08, 0.16, signed=True)

    def clock(self, evening: float) -> float:
        return self.drift * evening


class MarkerOffset(Cause, name="marker_offset", group="inside"):
    """The markers' centroid is not where the header says."""

    def draw(self, world: World) -> None:
        metres, turn = self.rng.uniform(0.010, 0.025) * self.scale, self.rng.uniform(-np.pi, np.pi)
        self.forward = self.note("forward_m", metres * np.cos(turn))
        self.left = self.note("left_m", metres * np.sin(turn))

    def since(self, frames: Frames) -> Array:
        """1 for frames with the offset."""
        return np.ones_like(frames.x)

    def camera(self, frames: Frames) -> None:
        cos, sin, on = np.cos(frames.heading), np.sin(frames.heading), self.since(frames)
        frames.x = frames.x + on * (self.forward * cos - self.left * sin)
        frames.y = frames.y + on * (self.forward * sin + self.left * cos)


class BumpedMarker(MarkerOffset, name="bumped_marker", group="time"):
    """The markers' centroid steps at some time in the middle of the campaign."""

    def draw(self, world: World) -> None:
        super().draw(world)
        self.moment = self.pick("at_share_of_campaign", 0.35, 0.65)

    def since(self, frames: Frames) -> Array:
        return np.where(frames.evening > self.moment, 1.0, 0.0)


class HeadingMisalignment(Cause, name="heading_misalignment", group="inside"):
    """The measured heading has a constant offset."""

    def draw(self, world: World) -> None:
        self.offset = self.size("offset_deg", 1.5, 4.0, signed=True) * DEGREE

    def camera(self, frames: Frames) -> None:
        frames.heading = frames.heading + self.offset


class MocapScale(Cause, name="mocap_scale", group="inside"):
    """Positions are measured too large or too small."""

    def draw(self, world: World) -> None:
        self.share = self.size("share", 0.015, 0.03, signed=True)

    def camera(self, frames: Frames) -> None:
        frames.x, frames.y = frames.x * (1 + self.share), frames.y * (1 + self.share)


# --- tables and files -------------------------------------------------------------------------------------------------


def choose(world: World, names: Sequence[str], vehicle: int, scale: float, seed: int) -> list[Cause]:
    """The causes with these names, in the order in which they act."""
    unknown = set(names) - set(Cause.registry)
    if unknown:
        raise ValueError(f"unknown causes: {', '.join(sorted(unknown))}")
    return [
        kind(world, generator("cause", vehicle, name, seed), scale)
        for name, kind in Cause.registry.items()
        if name in names
    ]


def run_id(world: World, run: int) -> str:
    """The name of a run."""
    return f"{run + 1:03d} {world.runs[run].manoeuvre.name} r{world.runs[run].repeat + 1}"


def runs_table(world: World) -> pd.DataFrame:
    """A row for each run."""
    count = len(world.runs)
    return pd.DataFrame(
        {
            "run_id": [run_id(world, run) for run in range(count)],
            "experiment": [run.manoeuvre.experiment for run in world.runs],
            "trajectory": [run.manoeuvre.name for run in world.runs],
            "condition": [""] * count,
            "repeat": [run.repeat for run in world.runs],
            "target_x_m": np.full(count, np.nan),
            "target_y_m": np.full(count, np.nan),
            "target_heading_rad": np.full(count, np.nan),
            "started_s": world.started,
            "status": ["ok"] * count,
            "firmware": ["sim"] * count,
            "session": [str(1 + int(start > 0)) for start in world.session],
        }
    )


def commands_table(world: World) -> pd.DataFrame:
    """The commands of all runs."""
    rows = [(run_id(world, run), *row) for run in range(len(world.runs)) for row in world.rows(run)]
    return pd.DataFrame(rows, columns=["run_id", "t_s", "drive", "front", "rear"])


def frames_of(
    world: World, causes: Sequence[Cause], run: int, motion: tuple[Array, Array], rng: np.random.Generator
) -> pd.DataFrame:
    """The poses that the camera reports of one run."""
    vehicle, last = world.vehicle, world.rows(run)[-1][0]
    t = np.arange(-REST_S[0] + rng.uniform(0, 1 / vehicle.rate_hz), last + REST_S[1], 1 / vehicle.rate_hz)
    late = sum(cause.clock(float(world.started[run]) / world.total_s) for cause in causes)
    pose = interpolate(motion[0][:, :, run], motion[1][:, :, run], t - late)
    frames = Frames((world.started[run] + t) / world.total_s, pose[:, 0], pose[:, 1], pose[:, 2])
    for cause in causes:
        cause.camera(frames)
    seen = rng.uniform(size=len(t)) > 0.004
    noise = rng.normal(size=(3, len(t))) * np.array([[vehicle.noise[0]], [vehicle.noise[0]], [vehicle.noise[1]]])
    heading = (frames.heading + noise[2] + np.pi) % (2 * np.pi) - np.pi
    values = {"x_m": frames.x + noise[0], "y_m": frames.y + noise[1], "heading_rad": heading}
    table: dict[str, Any] = {"run_id": run_id(world, run), "t_s": np.round(t, 6)}
    table |= {key: np.where(seen, value, np.nan) for key, value in values.items()}
    number = round(float(world.started[run]) * vehicle.rate_hz) + np.arange(len(t))
    return pd.DataFrame({**table, "tracked": seen, "frame": number})


def header(vehicle: Vehicle, number: int) -> str:
    """The text of campaign.toml."""
    return (
        f'schema = 1\nname = "vehicle {number}"\n\n[vehicle]\nname = "vehicle {number}"\n'
        f"front_axle_m = {vehicle.header_m[0]}\nrear_axle_m = {vehicle.header_m[1]}\n"
        f'command_unit = "us"\nneutral = {NEUTRAL_US}\n\n[mocap]\nrate_hz = {vehicle.rate_hz}\n'
    )


def write_campaign(
    directory: Path, vehicle: int, causes: Sequence[str], *, scale: float = 1.0, seed: int = 0
) -> dict[str, Any]:
    """Simulate a campaign, write its directory and the truth beside it, and return the truth."""
    body = Vehicle.draw(vehicle)
    world = World.draw(body, vehicle, seed)
    active = choose(world, causes, vehicle, scale, seed)
    directory = Path(directory)
    directory.mkdir(parents=True)
    motion = Simulation(world, active).run()
    rng = generator("camera", vehicle, seed)
    poses = [frames_of(world, active, run, motion, rng) for run in range(len(world.runs))]
    (directory / "campaign.toml").write_text(header(body, vehicle), encoding="utf-8")
    runs_table(world).to_parquet(directory / "runs.parquet", index=False)
    commands_table(world).to_parquet(directory / "commands.parquet", index=False)
    pd.concat(poses, ignore_index=True).to_parquet(directory / "poses.parquet", index=False)
    truth = {"vehicle": vehicle, "seed": seed, "causes": {cause.name: cause.values for cause in active}}
    beside = directory.with_name(directory.name + ".truth.json")
    beside.write_text(json.dumps(truth, indent=2) + "\n", encoding="utf-8")
    return truth


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    actions = parser.add_subparsers(dest="action", required=True)
    actions.add_parser("list", help="print the causes as JSON")
    write = actions.add_parser("write", help="write a campaign directory")
    write.add_argument("directory", type=Path)
    write.add_argument("--vehicle", type=int, required=True)
    write.add_argument("--causes", default="", help="names, separated by commas")
    write.add_argument("--scale", type=float, default=1.0)
    write.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    if given.action == "list":
        print(json.dumps({name: kind.group for name, kind in Cause.registry.items()}, indent=2))
        return
    names = [name.strip() for name in given.causes.split(",") if name.strip()]
    write_campaign(given.directory, given.vehicle, names, scale=given.scale, seed=given.seed)


if __name__ == "__main__":
    main()
