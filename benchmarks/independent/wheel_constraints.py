"""Simulates a campaign of a model vehicle with four wheels, both axles steered, under motion capture.

The twist of the body is at each instant the least-squares solution of the rolling constraints of its four wheels.
Twists are composed by the exact exponential map of SE(2). All runs of a campaign are simulated at once.
Axis 0 of arrays of axles is (front, rear). Angles are in rad and to the left, unless a name has another unit.
"""

import argparse
import json
import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Row = tuple[float, float, float, float]

STEP_S = 0.002
BEFORE_S = 0.5
AFTER_S = 1.0
FLOOR_M = 2.0  # half of the floor's side
NEUTRAL_US = 1500
DRIVE_US = 360.0
STEER_US = 400.0
MOVING_M_S = 0.01
KICK_S = 0.3
SIDE_WEIGHT = 1e3


# ---------------------------------------------------------------- causes and their sizes


# Each parameter of each cause has a range and a kind: "+" a strength, "±" a strength of either sign, "/" a value with
# more effect the smaller it is, "=" a place, direction or time that the scale leaves, "?" a choice of 0 or 1.
COURSE = (-math.pi, math.pi, "=")
MIDDLE = (0.35, 0.65, "=")
SIZES: dict[str, dict[str, dict[str, tuple[float, float, str]]]] = {
    "inside": {
        "actuation_delay": {"delay_s": (0.05, 0.15, "+")},
        "steering_lag": {"time_constant_s": (0.1, 0.3, "+")},
        "steering_rate_limit": {"rate_rad_s": (0.6, 1.5, "/")},
        "steering_backlash": {"front_width_deg": (2.0, 5.0, "+"), "rear_width_deg": (2.0, 5.0, "+")},
        "axle_coupling": {"front_from_rear": (0.05, 0.12, "+"), "rear_from_front": (0.05, 0.12, "+")},
        "reverse_steering_gain": {"share": (0.08, 0.2, "±")},
        "speed_lag": {"time_constant_s": (0.15, 0.4, "+"), "braking_time_constant_s": (0.1, 0.3, "+")},
        "cornering_speed_loss": {"share_per_tangent": (0.08, 0.2, "+")},
        "battery_droop": {"share_per_h": (0.05, 0.12, "+")},
        "lateral_slip": {"share_at_top_speed": (0.1, 0.25, "+")},
        "wheel_diameter_mismatch": {"curvature_1_m": (0.03, 0.1, "±")},
        "axle_speed_mismatch": {"rear_excess_share": (0.08, 0.2, "±")},
        "floor_tilt": {"drift_m_s": (0.008, 0.02, "+"), "course_rad": COURSE},
        "mocap_latency": {"latency_s": (0.03, 0.08, "±")},
        "marker_offset": {"distance_m": (0.01, 0.025, "+"), "bearing_rad": COURSE},
        "heading_misalignment": {"offset_deg": (1.5, 4.0, "±")},
        "mocap_scale": {"share": (0.015, 0.03, "±")},
    },
    "outside": {
        "pull_to_point": {"drift_m_s": (0.008, 0.014, "+"), "x_m": (-1.0, 1.0, "="), "y_m": (-1.0, 1.0, "=")},
        "speed_by_course": {"share": (0.025, 0.05, "+"), "course_rad": COURSE},
        "seam": {"kick_deg": (2.5, 5.0, "±"), "distance_m": (-0.3, 0.3, "="), "course_rad": COURSE},
        "wheel_eccentricity": {"heading_deg": (1.6, 3.2, "+"), "period_m": (0.3, 0.7, "="), "phase_rad": COURSE},
        "steering_hysteresis": {"half_width_deg": (0.6, 1.2, "+"), "memory_deg": (8.0, 20.0, "=")},
        "speed_steering_interaction": {"share_s_m_rad": (0.12, 0.25, "+")},
        "start_twist": {"kick_deg": (1.2, 2.2, "±")},
        "run_out": {"deceleration_m_s2": (1.5, 3.5, "/")},
        "slow_patch": {
            "share": (0.08, 0.15, "+"),
            "radius_m": (0.6, 0.9, "="),
            "x_m": (-0.5, 0.5, "="),
            "y_m": (-0.5, 0.5, "="),
        },
        "lateral_creep": {"creep_s": (0.1, 0.18, "+")},
        "servo_supply_dip": {"share": (0.14, 0.28, "+"), "recovery_s": (0.3, 0.6, "=")},
        "gust": {"amplitude_m_s": (0.012, 0.022, "+"), "period_s": (9.0, 20.0, "="), "phase_rad": COURSE},
    },
    "time": {
        "gain_fades": {"share": (0.05, 0.1, "±")},
        "bumped_marker": {"distance_m": (0.015, 0.03, "+"), "bearing_rad": COURSE, "after_share_of_campaign": MIDDLE},
        "wind_second_half": {"drift_m_s": (0.01, 0.02, "+"), "course_rad": COURSE},
        "warm_up": {
            "time_constant_at_first_s": (0.3, 0.55, "+"),
            "decay_h": (0.4, 0.9, "="),
            "of_speed_yes_1": (0, 2, "?"),
        },
        "battery_change": {"share_per_h": (0.05, 0.09, "+"), "after_share_of_campaign": MIDDLE},
        "drifting_clock": {"drift_s_per_h": (0.03, 0.06, "±")},
        "trim_step": {"step_deg": (1.0, 2.0, "±"), "of_rear_yes_1": (0, 2, "?"), "after_share_of_campaign": MIDDLE},
        "slow_evening": {"share": (0.05, 0.1, "+"), "decay_h": (0.4, 1.0, "=")},
    },
}
ALL = {name: sizes for group in SIZES.values() for name, sizes in group.items()}


def sample(rng: np.random.Generator, low: float, high: float, kind: str, scale: float) -> float:
    """Draws a value from a range of this kind."""
    value, sign = float(rng.uniform(low, high)), float(rng.choice((-1.0, 1.0)))
    factor = {"+": scale, "±": scale * sign, "/": 1 / scale}.get(kind, 1.0)
    return float(math.floor(value)) if kind == "?" else value * factor


@dataclass(frozen=True)
class Causes:
    """The active causes with the values of their parameters."""

    values: dict[str, dict[str, float]]

    def __contains__(self, cause: str) -> bool:
        """Whether a cause is active."""
        return cause in self.values

    def get(self, cause: str, parameter: str, default: float = 0.0) -> float:
        """A parameter of a cause, or the default where the cause is not active."""
        return self.values[cause][parameter] if cause in self.values else default


def draw_causes(vehicle: int, names: Sequence[str], scale: float, seed: int) -> Causes:
    """Draws the sizes of the causes: each depends only on the vehicle, the cause and the seed."""
    unknown = [name for name in names if name not in ALL]
    if unknown:
        raise ValueError(f"unknown causes: {', '.join(unknown)}")
    values = {}
    for name in names:
        rng = np.random.default_rng((vehicle, seed, zlib.crc32(name.encode())))
        values[name] = {parameter: sample(rng, *draw, scale) for parameter, draw in ALL[name].items()}
    return Causes(values)


# ---------------------------------------------------------------- the vehicle and its static curves


@dataclass(frozen=True)
class Servo:
    """A servo with a linkage: the sine of the axle's angle is linear in the sine of the horn's angle."""

    sign: float
    centre_us: float
    travel_rad: float
    mounting_rad: float
    ratio: float

    def angle(self, pulse_us: Array) -> Array:
        """The axle's angle to the left."""
        horn = self.sign * (pulse_us - self.centre_us) / STEER_US * self.travel_rad + self.mounting_rad
        return np.arcsin(self.ratio * (np.sin(horn) - math.sin(self.mounting_rad)))

    def pulse(self, share: float) -> float:
        """A whole pulse for a share of the working range to the left, as commanded by the experimenter."""
        return float(round(NEUTRAL_US + self.sign * STEER_US * share))


@dataclass(frozen=True)
class Vehicle:
    """What differs between vehicles; the reference point is the centroid of the markers."""

    front_m: float
    rear_m: float
    track_m: float
    header_m: tuple[float, float]
    servos: tuple[Servo, Servo]
    top_m_s: tuple[float, float]
    curve: str
    bend: float
    rate_hz: float
    noise_m: float
    noise_rad: float
    lost_share: float
    scatter_common_rad: float
    scatter_curvature_1_m: float
    scatter_speed: float

    @property
    def wheelbase_m(self) -> float:
        """The distance between the axles."""
        return self.front_m + self.rear_m

    def speed(self, pulse_us: Array) -> Array:
        """The static curve from the drive's pulse to the speed of the wheels."""
        share = (pulse_us - NEUTRAL_US) / DRIVE_US
        if self.curve == "s":
            shape = np.tanh(2.0 * self.bend * share) / math.tanh(2.0 * self.bend)
        elif self.curve == "cubic":
            shape = self.bend * share + (1 - self.bend) * share**3
        else:
            shape = share
        return np.where(share > 0, self.top_m_s[0], self.top_m_s[1]) * shape


def draw_servo(rng: np.random.Generator) -> Servo:
    """Draws a servo whose axle reaches 35° to 44° at the end of its working range."""
    travel, mounting = math.radians(rng.uniform(48, 62)), math.radians(rng.uniform(-8, 8))
    left, right = (abs(math.sin(mounting + side * travel) - math.sin(mounting)) for side in (1, -1))
    ratio = math.sin(math.radians(rng.uniform(35, 44))) / max(left, right)
    return Servo(float(rng.choice((-1.0, 1.0))), NEUTRAL_US + rng.uniform(-12, 12), travel, mounting, ratio)


def draw_vehicle(number: int) -> Vehicle:
    """Draws all that is the vehicle's own."""
    rng = np.random.default_rng((number, 11))
    wheelbase, share = rng.uniform(0.16, 0.4), rng.uniform(0.4, 0.6)
    front, rear = wheelbase * share, wheelbase * (1 - share)
    top = rng.uniform(0.35, 0.9)
    return Vehicle(
        front_m=front,
        rear_m=rear,
        track_m=wheelbase * rng.uniform(0.5, 0.7),
        header_m=(round(front + rng.uniform(-0.0015, 0.0015), 4), round(rear + rng.uniform(-0.0015, 0.0015), 4)),
        servos=(draw_servo(rng), draw_servo(rng)),
        top_m_s=(top, top * rng.uniform(0.92, 1.0)),
        curve=str(rng.choice(["s", "cubic", "linear"])),
        bend=rng.uniform(0.55, 0.9),
        rate_hz=float(rng.choice([60.0, 75.0, 90.0, 100.0, 120.0, 150.0])),
        noise_m=rng.uniform(0.0002, 0.0005),
        noise_rad=math.radians(rng.uniform(0.1, 0.3)),
        lost_share=rng.uniform(0.0005, 0.003),
        scatter_common_rad=math.radians(rng.uniform(0.05, 0.1)),
        scatter_curvature_1_m=rng.uniform(0.0004, 0.001),
        scatter_speed=rng.uniform(0.001, 0.002),
    )


# ---------------------------------------------------------------- the plan of the campaign


@dataclass(frozen=True)
class Group:
    """Identical runs: rows of time, drive, front and rear pulse; the last row ends the run."""

    name: str
    experiment: str
    repeats: int
    rows: tuple[Row, ...]


@dataclass
class Plan:
    """The runs in the order in which they are driven."""

    groups: list[Group]
    repeat: list[int]
    started_s: Array
    x_m: Array
    y_m: Array
    heading_rad: Array


Leg = tuple[float, float, float]  # shares of the range of the drive, the front and the rear axle


def make_group(
    vehicle: Vehicle, name: str, experiment: str, repeats: int, legs: Sequence[Leg], metres: float = 2.5
) -> Group:
    """Divides about the length into legs of equal duration; legs that stand still last 0.8 s."""
    drives = [leg[0] for leg in legs if leg[0]]
    speeds = np.abs(vehicle.speed(np.array([NEUTRAL_US + DRIVE_US * drive for drive in drives])))
    total = float(np.clip(metres / speeds.mean(), 2.0, 6.4))
    each, rows, now = round(total / len(drives), 2), [], 0.0
    for drive, front, rear in legs:
        pulses = vehicle.servos[0].pulse(front), vehicle.servos[1].pulse(rear)
        rows.append((round(now, 2), float(round(NEUTRAL_US + DRIVE_US * drive)), *pulses))
        now += each if drive else 0.8
    rows.append((round(now, 2), float(NEUTRAL_US), float(NEUTRAL_US), float(NEUTRAL_US)))
    return Group(name, experiment, repeats, tuple(rows))


def constant_groups(vehicle: Vehicle) -> list[Group]:
    """Straights at ten speeds, arcs of each kind, and fast and slow runs through the same arcs."""
    groups = []
    for drive in (0.35, 0.5, 0.65, 0.8, 1.0, -0.35, -0.5, -0.65, -0.8, -1.0):
        groups.append(make_group(vehicle, f"straight-{100 * drive:+.0f}", "drive", 3, [(drive, 0, 0)]))
    kinds = {"front": (1.0, 0.0), "rear": (0.0, 1.0), "opposite": (0.6, -0.6), "alike": (0.9, 0.9)}
    arcs = ((0.4, 0.7), (-0.4, 0.7), (0.95, 0.7), (-0.95, 0.7), (0.7, -0.7), (-0.7, -0.7))
    for kind, (front, rear) in kinds.items():
        experiment = "free" if kind == "alike" else f"steering_{kind}"
        for amount, drive in arcs:
            name = f"arc-{kind}-{100 * amount:+.0f}-{100 * drive:+.0f}"
            groups.append(make_group(vehicle, name, experiment, 3, [(drive, amount * front, amount * rear)]))
    for kind, front, rear in (("front", 0.6, 0.0), ("opposite", -0.35, 0.35)):
        for drive in (0.45, 1.0):
            name = f"speed-{kind}-{100 * drive:+.0f}"
            groups.append(make_group(vehicle, name, f"steering_{kind}", 3, [(drive, front, rear)]))
    return groups


def varied_groups(vehicle: Vehicle) -> list[Group]:
    """Runs whose steering or drive changes on the way."""
    steering: dict[str, list[Leg]] = {
        "s-left": [(0.7, 0.6, 0), (0.7, -0.6, 0)],
        "s-right-fast": [(1.0, -0.35, 0.35), (1.0, 0.35, -0.35)],
        "s-rear-backward": [(-0.6, 0, 0.6), (-0.6, 0, -0.6)],
        "slalom-front": [(0.7, side * 0.8, 0) for side in (1, -1, 1, -1, 1)],
        "slalom-opposite": [(0.8, side * 0.45, -side * 0.45) for side in (-1, 1, -1, 1)],
        "slalom-backward": [(-0.7, side * 0.6, 0) for side in (1, -1, 1, -1)],
        "lane-change": [(0.8, 0, 0), (0.8, 0.5, 0), (0.8, -0.5, 0), (0.8, 0, 0)],
        "lane-crab": [(0.6, 0, 0), (0.6, -0.7, -0.7), (0.6, 0, 0), (0.6, 0.4, 0.7)],
    }
    driving: dict[str, list[Leg]] = {
        "faster": [(0.45, 0, 0), (1.0, 0, 0)],
        "slower-arc": [(1.0, 0.4, 0), (0.45, 0.4, 0)],
        "staircase-arc": [(0.4, 0, 0.5), (0.7, 0, 0.5), (1.0, 0, 0.5), (0.6, 0, 0.5)],
        "stop-restart": [(0.8, 0, 0), (0, 0, 0), (0.8, 0, 0)],
        "stop-restart-arc": [(0.7, -0.5, 0), (0, -0.5, 0), (0.7, -0.5, 0), (0, 0, 0), (0.7, 0, 0)],
        "reversal": [(0.7, 0.3, 0), (-0.7, 0.3, 0)],
        "reversal-three-point": [(0.7, 0.8, 0), (-0.7, -0.8, 0), (0.7, 0.8, 0)],
        "reversal-backward-first": [(-0.8, 0.4, -0.4), (0, 0, 0), (0.8, -0.4, 0.4)],
    }
    groups = [make_group(vehicle, name, "trajectory", 4, legs, 2.8) for name, legs in steering.items()]
    return groups + [make_group(vehicle, name, "step", 3, legs, 2.8) for name, legs in driving.items()]


def order_runs(groups: Sequence[Group], rng: np.random.Generator) -> tuple[list[Group], list[int]]:
    """Spreads the repeats of each group over the campaign, and drives some repeats as adjacent pairs."""
    units: list[tuple[float, Group, int]] = []
    for group in groups:
        pair = 1 if rng.random() < 0.45 else 0
        places = group.repeats - pair
        paired = int(rng.integers(places))
        for place in range(places):
            units.append(((place + rng.random()) / places, group, 1 + (pair if place == paired else 0)))
    ordered = [group for _, group, count in sorted(units, key=lambda unit: unit[0]) for _ in range(count)]
    seen: dict[str, int] = {}
    repeats = []
    for group in ordered:
        repeats.append(seen.get(group.name, 0))
        seen[group.name] = repeats[-1] + 1
    return ordered, repeats


def place_run(x_m: Array, y_m: Array, rng: np.random.Generator) -> tuple[float, float, float]:
    """A random start pose from which a path that begins at the origin stays on the floor, if it can."""
    heading = rng.uniform(-math.pi, math.pi)
    along, across = math.cos(heading), math.sin(heading)
    start = []
    for path in (along * x_m - across * y_m, across * x_m + along * y_m):
        low, high = -FLOOR_M + 0.2 - path.min(), FLOOR_M - 0.2 - path.max()
        start.append(rng.uniform(low, high) if low < high else (low + high) / 2)
    return start[0], start[1], heading


def make_plan(vehicle: Vehicle, number: int, seed: int) -> Plan:
    """Draws the order, the times and the start poses of the runs."""
    rng = np.random.default_rng((number, seed, 23))
    groups = constant_groups(vehicle) + varied_groups(vehicle)
    ordered, repeats = order_runs(groups, rng)
    gaps = 25 + rng.gamma(1.5, 10.0, len(ordered))
    started = np.cumsum(gaps) / gaps.sum() * rng.uniform(1.5, 2.5) * 3600
    nothing = np.zeros(len(groups))
    trial = Plan(groups, [0] * len(groups), nothing, nothing, nothing, nothing)
    path = simulate(vehicle, trial, Causes({}), (np.zeros((2, len(groups))), np.ones(len(groups))))
    index = {group.name: position for position, group in enumerate(groups)}
    places = [place_run(path[0, :, index[each.name]], path[1, :, index[each.name]], rng) for each in ordered]
    x_m, y_m, heading = np.array(places).T
    return Plan(ordered, repeats, np.round(started - started[0], 2), x_m, y_m, heading)


# ---------------------------------------------------------------- small differences between runs


Scatter = tuple[Array, Array]  # of each run: offsets of the axles (2, runs), factor of the speed (runs)


def draw_scatter(vehicle: Vehicle, runs: int, rng: np.random.Generator) -> Scatter:
    """Offsets of the axles, for the most part alike, since their difference turns the vehicle; and of the speed."""
    alike = rng.normal(0, vehicle.scatter_common_rad, runs)
    half = rng.normal(0, vehicle.scatter_curvature_1_m, runs) * vehicle.wheelbase_m / 2
    return np.array([alike + half, alike - half]), 1 + rng.normal(0, vehicle.scatter_speed, runs)


@dataclass
class Setting:
    """All that stays the same while the runs are simulated."""

    vehicle: Vehicle
    plan: Plan
    causes: Causes
    angle: Array  # (steps, 2, runs) of the servos, at once
    speed: Array  # (steps, runs) of the wheels, at once
    servo_lag_s: Array
    speed_lag_s: Array
    forward_first: Mask
    drift_m_s: Array  # (2, runs) in the floor's frame


def pulses(plan: Plan, delay_s: float, steps: int) -> Array:
    """The pulses (steps, 3, runs) that take effect in each step."""
    times = (np.arange(steps) + 0.5) * STEP_S - delay_s
    result = np.empty((steps, 3, len(plan.groups)))
    for run, group in enumerate(plan.groups):
        rows = np.array([(-math.inf, NEUTRAL_US, NEUTRAL_US, NEUTRAL_US), *group.rows], dtype=float)
        result[:, :, run] = rows[np.searchsorted(rows[:, 0], times, side="right") - 1, 1:]
    return result


def share_of_campaign(plan: Plan) -> Array:
    """When each run starts, as a share of the campaign."""
    return plan.started_s / max(float(plan.started_s.max()), 1.0)


def speed_factor(plan: Plan, causes: Causes) -> Array:
    """How the speed of each run differs by the time of the campaign."""
    hours = plan.started_s / 3600
    factor = 1 - causes.get("battery_droop", "share_per_h") * hours
    if "battery_change" in causes:
        change = causes.get("battery_change", "after_share_of_campaign") * hours.max()
        factor *= 1 - causes.get("battery_change", "share_per_h") * (hours - np.where(hours >= change, change, 0.0))
    if "slow_evening" in causes:
        decay = causes.get("slow_evening", "decay_h")
        gone = (1 - np.exp(-hours / decay)) / (1 - math.exp(-hours.max() / decay))
        factor *= 1 - causes.get("slow_evening", "share") * gone
    return factor


def trimmed(angle: Array, plan: Plan, causes: Causes) -> Array:
    """The angles of the servos with a gain and a neutral that change with the time of the campaign."""
    share = share_of_campaign(plan)
    angle = angle * (1 + causes.get("gain_fades", "share") * share)
    if "trim_step" in causes:
        late = share >= causes.get("trim_step", "after_share_of_campaign")
        axle = int(causes.get("trim_step", "of_rear_yes_1"))
        angle[:, axle] += math.radians(causes.get("trim_step", "step_deg")) * late
    return angle


def lags(plan: Plan, causes: Causes) -> tuple[Array, Array]:
    """The time constants of the servos and of the speed in each run."""
    first = causes.get("warm_up", "time_constant_at_first_s")
    warming = first * np.exp(-plan.started_s / 3600 / causes.get("warm_up", "decay_h", 1.0))
    of_speed = causes.get("warm_up", "of_speed_yes_1")
    servo = causes.get("steering_lag", "time_constant_s") + (1 - of_speed) * warming
    return servo, causes.get("speed_lag", "time_constant_s") + of_speed * warming


def floor_drift(plan: Plan, causes: Causes) -> Array:
    """The constant drifts of each run in the floor's frame."""
    drift = np.zeros((2, len(plan.groups)))
    for cause, when in (("floor_tilt", 0.0), ("wind_second_half", 0.5)):
        course = causes.get(cause, "course_rad")
        amount = causes.get(cause, "drift_m_s") * (share_of_campaign(plan) >= when)
        drift += np.outer((math.cos(course), math.sin(course)), amount)
    return drift


def prepare(vehicle: Vehicle, plan: Plan, causes: Causes, scatter: Scatter) -> Setting:
    """Computes all that does not depend on the motion."""
    longest = max(group.rows[-1][0] for group in plan.groups)
    steps = math.ceil((longest + AFTER_S + 0.3) / STEP_S)
    pulse = pulses(plan, causes.get("actuation_delay", "delay_s"), steps)
    angle = np.stack([vehicle.servos[axle].angle(pulse[:, 1 + axle]) for axle in (0, 1)], axis=1)
    speed = vehicle.speed(pulse[:, 0]) * scatter[1] * speed_factor(plan, causes)
    forward = np.array([group.rows[0][1] > NEUTRAL_US for group in plan.groups])
    angle = trimmed(angle, plan, causes) + scatter[0]
    return Setting(vehicle, plan, causes, angle, speed, *lags(plan, causes), forward, floor_drift(plan, causes))


@dataclass
class State:
    """The state of all runs."""

    x: Array
    y: Array
    heading: Array
    target: Array  # (2, runs) last angle that the servos were to reach
    servo: Array  # (2, runs)
    axle: Array  # (2, runs)
    bent: Array  # (2, runs) angle by which the linkage is bent
    speed: Array
    supplied: Array  # the speed that the supply has recovered from
    distance: Array
    moved_s: Array


def approach(lag_s: Array) -> Array:
    """The share of the way to its target that a first-order lag covers in a step; all of it without a lag."""
    return np.where(lag_s > 0, 1 - np.exp(-STEP_S / np.maximum(lag_s, 1e-9)), 1.0)


def step_servos(state: State, setting: Setting, step: int) -> Array:
    """The angles of the axles after hysteresis, lag, limit of rate and play."""
    causes, target = setting.causes, setting.angle[step]
    if "steering_hysteresis" in causes:
        change = target - state.target
        most = np.sign(change) * math.radians(causes.get("steering_hysteresis", "half_width_deg"))
        memory = math.radians(causes.get("steering_hysteresis", "memory_deg"))
        state.bent = most + (state.bent - most) * np.exp(-np.abs(change) / memory)
    state.target = target
    limit = causes.get("steering_rate_limit", "rate_rad_s", math.inf) * STEP_S
    change = (target - state.bent - state.servo) * approach(setting.servo_lag_s)
    state.servo = state.servo + np.clip(change, -limit, limit)
    if "steering_backlash" in causes:
        half = [[math.radians(causes.get("steering_backlash", f"{axle}_width_deg")) / 2] for axle in ("front", "rear")]
        state.axle = np.clip(state.axle, state.servo - np.array(half), state.servo + np.array(half))
    else:
        state.axle = state.servo
    return state.axle


def step_speed(state: State, setting: Setting, step: int) -> Array:
    """The speed of the wheels after lag and coasting."""
    causes, target = setting.causes, setting.speed[step]
    braking = (np.abs(target) < np.abs(state.speed)) | (target * state.speed < 0)
    extra = setting.speed_lag_s - causes.get("speed_lag", "time_constant_s")
    lag = np.where(braking, causes.get("speed_lag", "braking_time_constant_s") + extra, setting.speed_lag_s)
    reached = state.speed + (target - state.speed) * approach(lag)
    if "run_out" in causes:
        slower = np.abs(state.speed) - causes.get("run_out", "deceleration_m_s2") * STEP_S
        coasting = np.sign(state.speed) * np.maximum(slower, 0.0)
        reached = np.where((target == 0) & (np.abs(coasting) > np.abs(reached)), coasting, reached)
    state.speed = np.where((target == 0) & (np.abs(reached) < MOVING_M_S), 0.0, reached)
    return state.speed


def wheel_angles(state: State, setting: Setting, step: int) -> Array:
    """The angles of the axles that the wheels have, after the supply, the coupling and the direction of travel."""
    causes, angles = setting.causes, state.axle
    if "servo_supply_dip" in causes:
        demand = np.abs(setting.speed[step])
        recovery = approach(np.full_like(demand, causes.get("servo_supply_dip", "recovery_s")))
        state.supplied = np.minimum(demand, state.supplied + (demand - state.supplied) * recovery)
        dip = causes.get("servo_supply_dip", "share") * (demand - state.supplied) / setting.vehicle.top_m_s[0]
        angles = angles * (1 - dip)
    if "axle_coupling" in causes:
        front, rear = (causes.get("axle_coupling", name) for name in ("front_from_rear", "rear_from_front"))
        angles = np.array([angles[0] + front * angles[1], angles[1] + rear * angles[0]])
    gain = 1 + causes.get("reverse_steering_gain", "share") * (state.speed < 0)
    return angles * gain


def constraint_twist(vehicle: Vehicle, angles: Array, axle_speeds: Array) -> Array:
    """The least-squares twist (vx, vy, yaw rate) of the rolling constraints of four wheels.

    Each wheel has the angle of true Ackermann steering. A differential in each axle divides the axle's speed, so
    the row of rolling is for the speed of its axle. No sideways motion weighs far more than the speed of rolling.
    The result has vx = (v_front cos δ_front + v_rear cos δ_rear) / 2.
    """
    x = np.array([vehicle.front_m, vehicle.front_m, -vehicle.rear_m, -vehicle.rear_m])
    y = np.array([1.0, -1.0, 1.0, -1.0]) * vehicle.track_m / 2
    tangents = np.tan(angles)
    yaw = (tangents[0] - tangents[1]) / vehicle.wheelbase_m
    side = (vehicle.rear_m * tangents[0] + vehicle.front_m * tangents[1]) / vehicle.wheelbase_m
    ahead, across = 1 - np.outer(yaw, y), side[:, None] + np.outer(yaw, x)
    size_of = np.hypot(ahead, across)
    ux, uy = ahead / size_of, across / size_of
    rolling = np.stack([ux, uy, uy * x - ux * y], axis=-1) / size_of[..., None]
    sideways = np.stack([-uy, ux, uy * y + ux * x], axis=-1) * SIDE_WEIGHT
    rows = np.concatenate([rolling, sideways], axis=1)
    speeds = np.repeat((axle_speeds * np.cos(angles)).T, 2, axis=1)
    transposed = rows.transpose(0, 2, 1)
    right = transposed[:, :, :4] @ speeds[..., None]
    return np.linalg.solve(transposed @ rows, right)[..., 0].T


def step_body(state: State, setting: Setting, angles: Array) -> Array:
    """The twist of the body on a level and even floor."""
    causes, vehicle, tangents = setting.causes, setting.vehicle, np.abs(np.tan(angles)).sum(axis=0)
    speed = state.speed * np.maximum(1 - causes.get("cornering_speed_loss", "share_per_tangent") * tangents, 0.2)
    rear = speed * (1 + causes.get("axle_speed_mismatch", "rear_excess_share"))
    vx, vy, yaw = constraint_twist(vehicle, angles, np.array([speed, rear]))
    v = np.hypot(vx, vy)
    if "lateral_slip" in causes:
        share = min(causes.get("lateral_slip", "share_at_top_speed"), 0.8)
        yaw = yaw / (1 + share / (1 - share) * (v / vehicle.top_m_s[0]) ** 2)
    if "speed_steering_interaction" in causes:
        loss = causes.get("speed_steering_interaction", "share_s_m_rad") * v * np.abs(angles[0] - angles[1])
        yaw = yaw * np.maximum(1 - loss, 0.2)
    yaw = yaw + (causes.get("wheel_diameter_mismatch", "curvature_1_m") + eccentricity(state, causes)) * vx
    if "start_twist" in causes:
        kicked = setting.forward_first & (vx > MOVING_M_S) & (state.moved_s < KICK_S)
        yaw = yaw + kicked * math.radians(causes.get("start_twist", "kick_deg")) / KICK_S
    state.moved_s = state.moved_s + STEP_S * ((v > MOVING_M_S) | (state.moved_s > 0))
    state.distance = state.distance + vx * STEP_S
    return np.array([vx, vy - causes.get("lateral_creep", "creep_s") * vx * yaw, yaw])


def eccentricity(state: State, causes: Causes) -> Array:
    """The curvature of a wheel that is not centred, by the distance that it has rolled."""
    if "wheel_eccentricity" not in causes:
        return np.zeros_like(state.x)
    wave = 2 * math.pi / causes.get("wheel_eccentricity", "period_m")
    amplitude = math.radians(causes.get("wheel_eccentricity", "heading_deg")) * wave
    return amplitude * np.sin(wave * state.distance + causes.get("wheel_eccentricity", "phase_rad"))


def step_floor(state: State, setting: Setting, twist: Array, step: int) -> Array:
    """The twist on the real floor: places and courses with another speed, drifts of a moving vehicle."""
    causes, factor = setting.causes, np.ones_like(state.x)
    moving = np.hypot(twist[0], twist[1]) > MOVING_M_S
    if "speed_by_course" in causes:
        course = state.heading + np.arctan2(twist[1], twist[0]) - causes.get("speed_by_course", "course_rad")
        factor = factor * (1 + causes.get("speed_by_course", "share") * np.cos(course))
    if "slow_patch" in causes:
        x, y, radius = (causes.get("slow_patch", name) for name in ("x_m", "y_m", "radius_m"))
        inside = np.hypot(state.x - x, state.y - y) < radius
        factor = factor * (1 - causes.get("slow_patch", "share") * inside)
    vx, vy, yaw = twist * factor
    drift_x, drift_y = setting.drift_m_s
    if "pull_to_point" in causes:
        to_x, to_y = (causes.get("pull_to_point", name) - place for name, place in (("x_m", state.x), ("y_m", state.y)))
        pull = causes.get("pull_to_point", "drift_m_s") / np.maximum(np.hypot(to_x, to_y), 0.1)
        drift_x, drift_y = drift_x + pull * to_x, drift_y + pull * to_y
    if "gust" in causes:
        angle = 2 * math.pi / causes.get("gust", "period_s") * (setting.plan.started_s + step * STEP_S)
        vy = vy + moving * causes.get("gust", "amplitude_m_s") * np.sin(angle + causes.get("gust", "phase_rad"))
    middle = state.heading + yaw * STEP_S / 2
    cos, sin = np.cos(middle) * moving, np.sin(middle) * moving
    return np.array([vx + cos * drift_x + sin * drift_y, vy - sin * drift_x + cos * drift_y, yaw])


def advance(state: State, twist: Array, causes: Causes) -> None:
    """Moves each body by the exponential of its twist for a step; a seam turns those that cross it."""
    along, across, turn = twist * STEP_S
    sine, versine = np.sinc(turn / math.pi), np.sin(turn / 2) * np.sinc(turn / (2 * math.pi))
    ahead, left = sine * along - versine * across, versine * along + sine * across
    cos, sin = np.cos(state.heading), np.sin(state.heading)
    x, y = state.x + cos * ahead - sin * left, state.y + sin * ahead + cos * left
    if "seam" in causes:
        course, distance = causes.get("seam", "course_rad"), causes.get("seam", "distance_m")
        before, after = (
            math.cos(course) * px + math.sin(course) * py > distance for px, py in ((state.x, state.y), (x, y))
        )
        crossed = after.astype(float) - before.astype(float)
        turn = turn + crossed * math.radians(causes.get("seam", "kick_deg"))
    state.x, state.y, state.heading = x, y, state.heading + turn


def simulate(vehicle: Vehicle, plan: Plan, causes: Causes, scatter: Scatter) -> Array:
    """The true poses (3, steps + 1, runs) of the centroid from the first command on."""
    setting = prepare(vehicle, plan, causes, scatter)
    neutral = [[float(servo.angle(np.array([float(NEUTRAL_US)]))[0])] for servo in vehicle.servos]
    rest = trimmed(np.array([neutral + np.zeros((2, len(plan.groups)))]), plan, causes)[0] + scatter[0]
    nothing, start = np.zeros(len(plan.groups)), (plan.x_m, plan.y_m, plan.heading_rad)
    state = State(*start, rest, rest, rest, np.zeros_like(rest), nothing, nothing, nothing, nothing)
    poses = [np.array([state.x, state.y, state.heading])]
    for step in range(len(setting.speed)):
        step_servos(state, setting, step)
        step_speed(state, setting, step)
        twist = step_body(state, setting, wheel_angles(state, setting, step))
        advance(state, step_floor(state, setting, twist, step), causes)
        poses.append(np.array([state.x, state.y, state.heading]))
    return np.stack(poses, axis=1)


# ---------------------------------------------------------------- the camera


def displaced(pose: Array, plan: Plan, causes: Causes, run: int) -> Array:
    """The place and heading that the camera measures of true poses (3, frames), without noise."""
    x, y, heading = pose
    late = share_of_campaign(plan)[run] >= causes.get("bumped_marker", "after_share_of_campaign")
    for cause, active in (("marker_offset", True), ("bumped_marker", late)):
        distance, bearing = causes.get(cause, "distance_m") * active, causes.get(cause, "bearing_rad")
        x, y = x + distance * np.cos(heading + bearing), y + distance * np.sin(heading + bearing)
    scale = 1 + causes.get("mocap_scale", "share")
    return np.array([x * scale, y * scale, heading + math.radians(causes.get("heading_misalignment", "offset_deg"))])


def observe(vehicle: Vehicle, plan: Plan, causes: Causes, path: Array, rng: np.random.Generator) -> pd.DataFrame:
    """The frames of all runs, stamped by the camera's own clock."""
    tables, grid, phase = [], np.arange(path.shape[1]) * STEP_S, rng.uniform(0, 1 / vehicle.rate_hz)
    for run, (group, started) in enumerate(zip(plan.groups, plan.started_s, strict=True)):
        ends = started - BEFORE_S, started + group.rows[-1][0] + AFTER_S
        frame = np.arange(*(math.ceil((end - phase) * vehicle.rate_hz) for end in ends))
        stamp = frame / vehicle.rate_hz + phase - started
        true = stamp - causes.get("mocap_latency", "latency_s")
        true = true - causes.get("drifting_clock", "drift_s_per_h") * started / 3600
        pose = displaced(np.array([np.interp(true, grid, row[:, run]) for row in path]), plan, causes, run)
        pose += rng.normal(size=pose.shape) * np.array([[vehicle.noise_m], [vehicle.noise_m], [vehicle.noise_rad]])
        lost = rng.random(len(frame)) < vehicle.lost_share
        pose[2] = np.angle(np.exp(1j * pose[2]))
        pose[:, lost] = math.nan
        columns = {"t_s": stamp, "x_m": pose[0], "y_m": pose[1], "heading_rad": pose[2]}
        table = pd.DataFrame({"run_id": run_id(plan, run), **columns, "tracked": ~lost, "frame": frame})
        tables.append(table[(rng.random(len(frame)) >= vehicle.lost_share)])
    return pd.concat(tables, ignore_index=True)


# ---------------------------------------------------------------- the files


def run_id(plan: Plan, run: int) -> str:
    """The identifier of a run."""
    return f"{plan.groups[run].name}-r{plan.repeat[run] + 1:02d}"


def runs_table(plan: Plan) -> pd.DataFrame:
    """The table of runs."""
    groups = plan.groups
    columns: dict[str, object] = {
        "run_id": [run_id(plan, run) for run in range(len(groups))],
        "experiment": [group.experiment for group in groups],
        "trajectory": [group.name if group.experiment == "trajectory" else "" for group in groups],
        "condition": "",
        "repeat": plan.repeat,
    }
    columns |= dict.fromkeys(("target_x_m", "target_y_m", "target_heading_rad"), math.nan)
    columns |= {"started_s": plan.started_s, "status": "ok", "firmware": "sim", "session": "1"}
    return pd.DataFrame(columns)


def commands_table(plan: Plan) -> pd.DataFrame:
    """The table of commands."""
    rows = [(run_id(plan, run), *row) for run, group in enumerate(plan.groups) for row in group.rows]
    return pd.DataFrame(rows, columns=["run_id", "t_s", "drive", "front", "rear"])


def header(vehicle: Vehicle, number: int) -> str:
    """The text of campaign.toml."""
    return (
        f'schema = 1\nname = "vehicle {number}"\n\n[vehicle]\nname = "vehicle {number}"\n'
        f"front_axle_m = {vehicle.header_m[0]}\nrear_axle_m = {vehicle.header_m[1]}\n"
        f'command_unit = "us"\nneutral = {float(NEUTRAL_US)}\n\n[mocap]\nrate_hz = {vehicle.rate_hz}\n'
    )


def write_campaign(
    directory: Path, vehicle: int, causes: Sequence[str], *, scale: float = 1.0, seed: int = 0
) -> dict[str, object]:
    """Writes a campaign and, beside its directory, the truth, which is also the result."""
    drawn, body = draw_causes(vehicle, causes, scale, seed), draw_vehicle(vehicle)
    directory = Path(directory)
    directory.mkdir(parents=True)
    plan = make_plan(body, vehicle, seed)
    rng = np.random.default_rng((vehicle, seed, 37))
    path = simulate(body, plan, drawn, draw_scatter(body, len(plan.groups), rng))
    frames = observe(body, plan, drawn, path, rng)
    (directory / "campaign.toml").write_text(header(body, vehicle))
    runs_table(plan).to_parquet(directory / "runs.parquet", index=False)
    commands_table(plan).to_parquet(directory / "commands.parquet", index=False)
    frames.to_parquet(directory / "poses.parquet", index=False)
    truth: dict[str, object] = {"vehicle": vehicle, "seed": seed, "causes": drawn.values}
    directory.with_name(directory.name + ".truth.json").write_text(json.dumps(truth, indent=2) + "\n")
    return truth


def main(arguments: Sequence[str] | None = None) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("list", help="print all causes as JSON")
    write = commands.add_parser("write", help="write a campaign")
    write.add_argument("directory", type=Path)
    write.add_argument("--vehicle", type=int, required=True)
    write.add_argument("--causes", default="", help="names, separated by commas")
    write.add_argument("--scale", type=float, default=1.0)
    write.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    if options.command == "list":
        print(json.dumps({name: group for group, names in SIZES.items() for name in names}, indent=2))
        return
    names = [name.strip() for name in options.causes.split(",") if name.strip()]
    write_campaign(options.directory, options.vehicle, names, scale=options.scale, seed=options.seed)


if __name__ == "__main__":
    main()
