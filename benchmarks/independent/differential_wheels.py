"""Simulator of a differential-drive robot under motion capture; writes campaign directories."""

from __future__ import annotations

import argparse
import json
import math
import zlib
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
Rng = np.random.Generator

STEP_S = 0.002
ROW_S = 0.02
LEAD_S = 0.5
TAIL_S = 1.0
MOTOR_TAU_S = 0.005
HALF_FLOOR_M = 1.8
REACH_M = 3.0
LOST_FRACTION = 0.004
MOVING_M_S = 0.02


def stream(*keys: int | str) -> Rng:
    """Random stream that depends on the keys alone."""
    words = [zlib.crc32(k.encode()) if isinstance(k, str) else int(k) for k in keys]
    return np.random.default_rng(np.random.SeedSequence(words))


def signed(rng: Rng, low: float, high: float) -> float:
    """Uniform magnitude with a random sign."""
    sign = 1.0 if rng.random() < 0.5 else -1.0
    return sign * float(rng.uniform(low, high))


@dataclass(frozen=True)
class Static:
    """Smooth monotone static map from a command to what the body does; zero at zero."""

    greatest: float
    gain: float
    curvature: float
    negative_factor: float

    def __call__(self, command: Array) -> Array:
        """True rate for a command; levels off at 1.1 times the greatest command."""
        u = command / self.greatest
        u = u / (1.0 + (np.abs(u) / 1.1) ** 16) ** (1.0 / 16.0)
        y: Array = self.gain * self.greatest * u * (1.0 + self.curvature * (u * u - 0.5))
        factor: Array = np.where(u < 0.0, self.negative_factor, 1.0)
        return factor * y


@dataclass(frozen=True)
class Vehicle:
    """What belongs to the vehicle and to the room's cameras."""

    number: int
    track_m: float
    wheel_radius_m: float
    axle_to_marker_m: float
    header_rear_axle_m: float
    speed: Static
    yaw: Static
    speed_scatter: float
    yaw_scatter: float
    rate_hz: float
    position_noise_m: float
    heading_noise_rad: float

    @classmethod
    def draw(cls, number: int) -> Vehicle:
        """Vehicle of that number."""
        r = stream(number, "vehicle")
        track = float(r.uniform(0.15, 0.5))
        radius = track * float(r.uniform(0.12, 0.22))
        marker = float(r.uniform(-0.05, 0.15))
        header = round(marker + float(r.uniform(-0.00095, 0.00095)), 5)
        speed = Static(
            round(float(r.uniform(0.3, 0.9)), 2),
            float(r.uniform(0.8, 1.1)),
            float(r.uniform(-0.06, 0.06)),
            1.0 + float(r.uniform(-0.04, 0.04)),
        )
        yaw = Static(
            round(float(r.uniform(1.0, 2.5)), 2),
            float(r.uniform(0.6, 1.05)),
            float(r.uniform(-0.06, 0.06)),
            1.0 + float(r.uniform(-0.02, 0.02)),
        )
        return cls(
            number, track, radius, marker, header, speed, yaw,
            float(r.uniform(0.001, 0.003)),
            float(r.uniform(0.001, 0.003)),
            float(r.choice([50.0, 60.0, 75.0, 100.0, 120.0, 150.0])),
            float(r.uniform(0.0002, 0.0005)),
            math.radians(float(r.uniform(0.1, 0.3))),
        )  # fmt: skip


@dataclass(frozen=True)
class Manoeuvre:
    """A named list of command rows (t, speed, yaw rate), the last one a stop."""

    name: str
    experiment: str
    rows: Array

    @property
    def stop_s(self) -> float:
        """Time of the stop command."""
        return float(self.rows[-1, 0])


@dataclass(frozen=True)
class Run:
    """One planned run: manoeuvre, repeat, start of the axle's middle, time of the evening."""

    run_id: str
    manoeuvre: Manoeuvre
    repeat: int
    started_s: float
    x_m: float
    y_m: float
    heading_rad: float


def on_grid(t: float) -> float:
    """Time rounded to the grid of command rows."""
    return round(round(t / ROW_S) * ROW_S, 6)


def held(name: str, experiment: str, parts: list[tuple[float, float, float]]) -> Manoeuvre:
    """Manoeuvre of parts (duration, speed, yaw rate), each held."""
    rows: list[tuple[float, float, float]] = []
    t = 0.0
    for duration, drive, yaw in parts:
        rows.append((on_grid(t), drive, yaw))
        t = on_grid(t + duration)
    rows.append((on_grid(t), 0.0, 0.0))
    return Manoeuvre(name, experiment, np.array(rows))


def manoeuvres(vehicle: Vehicle, rng: Rng) -> list[Manoeuvre]:
    """All manoeuvres of the campaign for this vehicle."""
    top_v, top_w = vehicle.speed.greatest, vehicle.yaw.greatest

    def stretch() -> float:
        return float(rng.uniform(0.95, 1.05))

    def lasting(v: float, most: float) -> float:
        return float(np.clip(REACH_M / (1.15 * abs(v)), 2.1, most)) * stretch()

    found: list[Manoeuvre] = []
    for way, sign in (("forward", 1.0), ("backward", -1.0)):
        for part in (0.2, 0.4, 0.6, 0.8, 1.0):
            v = sign * part * top_v
            name = f"straight_{way}_{round(100 * part):03d}"
            found.append(held(name, "drive", [(lasting(v, 5.0), v, 0.0)]))
    for way, sign in (("left", 1.0), ("right", -1.0)):
        for part in (0.2, 0.4, 0.6, 0.8, 1.0):
            w = sign * part * top_w
            name = f"turn_{way}_{round(100 * part):03d}"
            duration = float(np.clip(7.0 / abs(w), 2.1, 5.0)) * stretch()
            found.append(held(name, "yaw_rate", [(duration, 0.0, w)]))
    for way, sign in (("left", 1.0), ("right", -1.0)):
        for pv, pw in ((0.4, 0.3), (0.6, 0.6), (0.8, 0.4), (1.0, 0.8), (-0.5, 0.5)):
            v, w = pv * top_v, sign * pw * top_w
            facing = "arc" if pv > 0 else "arc_back"
            name = f"{facing}_{way}_{round(100 * abs(pv)):03d}_{round(100 * pw):03d}"
            found.append(held(name, "trajectory", [(lasting(v, 6.0), v, w)]))
        v = 0.6 * top_v
        duration = on_grid(max(lasting(v, 7.0), 3.0))
        n = round(duration / ROW_S)
        t = np.arange(n) * ROW_S
        wave = sign * 0.6 * top_w * np.sin(2.0 * np.pi * (t + 0.5 * ROW_S) / duration)
        rows = np.column_stack([np.round(t, 6), np.full(n, v), wave])
        rows = np.vstack([rows, [duration, 0.0, 0.0]])
        found.append(Manoeuvre(f"s_curve_{way}", "trajectory", rows))
        part = 0.5 if sign > 0 else 0.8
        beat = 0.8 * stretch()
        v, w = part * top_v, sign * 0.55 * top_w
        swings = [(0.5 * beat, v, w)]
        swings += [(beat, v, w * (-1.0) ** (k + 1)) for k in range(int(lasting(v, 6.0) / beat))]
        name = "slalom_slow" if sign > 0 else "slalom_fast"
        found.append(held(name, "trajectory", swings))
    for name, pw in (("stop_and_go", 0.0), ("stop_and_go_turning", 0.35)):
        go = (1.2 * stretch(), 0.55 * top_v, pw * top_w)
        halt = (0.8 * stretch(), 0.0, 0.0)
        found.append(held(name, "trajectory", [go, halt, go, halt, go]))
    for name, sign in (("speed_steps_forward", 1.0), ("speed_steps_backward", -1.0)):
        beat = 1.1 * stretch()
        steps = [(beat, sign * p * top_v, 0.0) for p in (0.3, 0.65, 1.0, 0.4)]
        found.append(held(name, "trajectory", steps))
    for name, sign in (("yaw_steps_left", 1.0), ("yaw_steps_right", -1.0)):
        beat = 1.0 * stretch()
        steps = [(beat, 0.5 * top_v, sign * p * top_w) for p in (0.0, 0.5, 0.0, -0.85, 0.3)]
        found.append(held(name, "trajectory", steps))
    for name, pw in (("reversals", 0.0), ("reversals_turning", 0.4)):
        beat = 1.5 * stretch()
        back = [(beat, s * 0.6 * top_v, pw * top_w) for s in (1.0, -1.0, 1.0, -1.0)]
        found.append(held(name, "trajectory", back))
    return found


def nominal_path(vehicle: Vehicle, manoeuvre: Manoeuvre) -> tuple[Array, Array]:
    """Path of the axle's middle from the origin without any lag, in closed-form arcs."""
    t = np.arange(round(manoeuvre.stop_s / ROW_S)) * ROW_S
    at = np.searchsorted(manoeuvre.rows[:, 0], t + 0.5 * ROW_S, side="right") - 1
    v = vehicle.speed(manoeuvre.rows[at, 1])
    turn = vehicle.yaw(manoeuvre.rows[at, 2]) * ROW_S
    middle = np.cumsum(turn) - 0.5 * turn
    chord = v * ROW_S * np.sinc(turn / (2.0 * np.pi))
    x = np.concatenate([[0.0], np.cumsum(chord * np.cos(middle))])
    y = np.concatenate([[0.0], np.cumsum(chord * np.sin(middle))])
    return x, y


def start_pose(path: tuple[Array, Array], rng: Rng) -> tuple[float, float, float]:
    """Start pose that keeps the path on the floor."""
    best: tuple[float, float, float, float] | None = None
    for _ in range(60):
        heading = float(rng.uniform(-np.pi, np.pi))
        fx, fy = rng.random(2).tolist()
        c, s = math.cos(heading), math.sin(heading)
        pose: list[float] = []
        excess = 0.0
        for along, f in ((c * path[0] - s * path[1], fx), (s * path[0] + c * path[1], fy)):
            low = -HALF_FLOOR_M - float(along.min())
            high = HALF_FLOOR_M - float(along.max())
            excess = max(excess, low - high)
            pose.append(low + f * (high - low) if high > low else 0.5 * (low + high))
        if best is None or excess < best[3]:
            best = (pose[0], pose[1], heading, excess)
        if excess <= 0.0:
            break
    assert best is not None
    return best[:3]


def plan(vehicle: Vehicle, seed: int) -> list[Run]:
    """Runs of the evening in the order they are driven."""
    rng = stream(vehicle.number, seed, "plan")
    kinds = manoeuvres(vehicle, rng)
    n = len(kinds)
    extra = set(rng.choice(n, size=int(rng.integers(0, 139 - 3 * n)), replace=False).tolist())
    paired = set(rng.choice(n, size=n // 4, replace=False).tolist())
    order: list[tuple[int, bool]] = []
    for lap in range(4):
        for k in rng.permutation(n).tolist():
            if (lap == 3 and k not in extra) or (lap == 1 and k in paired):
                continue
            order.append((k, False))
            if lap == 0 and k in paired:
                order.append((k, True))
    length_s = float(rng.uniform(1.5, 2.5)) * 3600.0
    gaps = np.zeros(len(order))
    free = np.zeros(len(order), dtype=bool)
    for i in range(1, len(order)):
        before = kinds[order[i - 1][0]].stop_s + TAIL_S + LEAD_S
        gaps[i] = before + float(rng.uniform(4.0, 9.0))
        free[i] = not order[i][1]
    weight = np.where(free, rng.uniform(0.4, 1.6, len(order)), 0.0)
    rests = rng.choice(np.flatnonzero(free), size=3, replace=False)
    weight[rests] += rng.uniform(4.0, 9.0, 3)
    gaps += weight / weight.sum() * (length_s - 60.0 - gaps.sum())
    started = np.round(20.0 + np.cumsum(gaps), 3)
    runs: list[Run] = []
    count = [0] * n
    pose = (0.0, 0.0, 0.0)
    for i, (k, again) in enumerate(order):
        if not again:
            pose = start_pose(nominal_path(vehicle, kinds[k]), rng)
        at = np.array(pose) + rng.normal(0.0, 1.0, 3) * [0.006, 0.006, 0.012]
        runs.append(Run(f"run_{i + 1:04d}", kinds[k], count[k], float(started[i]), *map(float, at)))
        count[k] += 1
    return runs


@dataclass
class State:
    """State of all runs at one instant of the integration."""

    x: Array
    y: Array
    heading: Array
    wheel_angle: Array
    castor_m: Array
    moving: Array


@dataclass(frozen=True)
class World:
    """What a cause may look at when it draws its size."""

    vehicle: Vehicle
    runs: list[Run]

    @property
    def started(self) -> Array:
        """Start times of the runs."""
        return np.array([r.started_s for r in self.runs])

    @property
    def length_s(self) -> float:
        """Length of the campaign."""
        return self.runs[-1].started_s + self.runs[-1].manoeuvre.stop_s + TAIL_S


Pair = tuple[Array, Array]


@dataclass(frozen=True)
class Effect:
    """Sizes of a cause and its hooks in the order of the integration.

    delay_s: shift of the commands; command(drive, yaw) and target(v, w, campaign time): all steps
    at once; setpoint(v, w), ground_speed(v, state), yaw_rate(w, v, state), drift(state): one step;
    latency_s: age of a pose; marker(campaign time): more (forward, left); measure(x, y, heading).
    """

    sizes: dict[str, Any]
    delay_s: float = 0.0
    command: Callable[[Array, Array], Pair] | None = None
    target: Callable[[Array, Array, Array], Pair] | None = None
    setpoint: Callable[[Array, Array], Pair] | None = None
    ground_speed: Callable[[Array, State], Array] | None = None
    yaw_rate: Callable[[Array, Array, State], Array] | None = None
    drift: Callable[[State], Pair] | None = None
    latency_s: float = 0.0
    marker: Callable[[Array], Pair] | None = None
    measure: Callable[[Array, Array, Array], tuple[Array, Array, Array]] | None = None


Draw = Callable[[World, Rng, float], Effect]
CAUSES: dict[str, tuple[str, Draw]] = {}


def cause(kind: str) -> Callable[[Draw], Draw]:
    """Register a function that draws a cause; causes act in the order of this file."""

    def register(draw: Draw) -> Draw:
        CAUSES[draw.__name__] = (kind, draw)
        return draw

    return register


@cause("inside")
def actuation_delay(world: World, rng: Rng, scale: float) -> Effect:
    """Commands act later than they are given."""
    delay = float(rng.uniform(0.06, 0.15)) * scale
    return Effect({"delay_s": delay}, delay_s=delay)


@cause("inside")
def drive_dead_band(world: World, rng: Rng, scale: float) -> Effect:
    """No forward motion for small speed commands."""
    part = float(rng.uniform(0.05, 0.12)) * scale
    width = part * world.vehicle.speed.greatest
    return Effect(
        {"width_m_s": width, "part_of_greatest": part},
        command=lambda drive, yaw: (np.sign(drive) * np.maximum(np.abs(drive) - width, 0.0), yaw),
    )


@cause("inside")
def battery_droop(world: World, rng: Rng, scale: float) -> Effect:
    """Forward speed falls with the time since the campaign's start."""
    loss = float(rng.uniform(0.02, 0.06)) * scale
    return Effect({"per_hour": loss}, target=lambda v, w, clock: (v * (1.0 - loss * clock / 3600.0), w))


@cause("time")
def warm_up(world: World, rng: Rng, scale: float) -> Effect:
    """Forward speed rises as the drive warms up."""
    rise = float(rng.uniform(0.04, 0.08)) * scale
    return Effect(
        {"rise": rise, "time_constant_s": 1200.0},
        target=lambda v, w, clock: (v * (1.0 + rise * (1.0 - np.exp(-clock / 1200.0))), w),
    )


@cause("time")
def gain_fades(world: World, rng: Rng, scale: float) -> Effect:
    """Yaw rate gain falls linearly over the campaign."""
    loss = float(rng.uniform(0.04, 0.08)) * scale
    length = world.length_s
    return Effect(
        {"loss_over_campaign": loss},
        target=lambda v, w, clock: (v, w * (1.0 - loss * clock / length)),
    )


def closing(tau_s: float) -> float:
    """Part of a gap that a first-order lag closes in one step."""
    return 1.0 - math.exp(-STEP_S / max(tau_s, 1e-9))


@cause("inside")
def speed_lag(world: World, rng: Rng, scale: float) -> Effect:
    """First-order lag of the forward speed, other constants for growing and falling."""
    grow, fall = (rng.uniform(0.1, 0.3, 2) * scale).tolist()
    up, down = closing(grow), closing(fall)
    now = np.zeros(len(world.runs))

    def setpoint(v: Array, w: Array) -> Pair:
        nonlocal now
        grows = (np.abs(v) > np.abs(now)) & (v * now >= 0.0)
        now = now + np.where(grows, up, down) * (v - now)
        return now, w

    return Effect({"tau_growing_s": grow, "tau_falling_s": fall}, setpoint=setpoint)


@cause("inside")
def motor_inertia(world: World, rng: Rng, scale: float) -> Effect:
    """Both wheels' speed controllers are of second order, and so are speed and yaw rate; integrated by Verlet steps."""
    period = float(rng.uniform(0.06, 0.12)) * scale
    damping = float(rng.uniform(0.7, 1.1))
    rates = [np.zeros(len(world.runs)) for _ in range(4)]

    def setpoint(v: Array, w: Array) -> Pair:
        for k, aim in ((0, v), (2, w)):
            push = (aim - rates[k]) / period**2 - 2.0 * damping / period * rates[k + 1]
            rates[k + 1] = rates[k + 1] + STEP_S * push
            rates[k] = rates[k] + STEP_S * rates[k + 1]
        return rates[0], rates[2]

    return Effect({"inertia_s": period, "time_constant_s": 2.0 * damping * period}, setpoint=setpoint)


@cause("inside")
def steering_lag(world: World, rng: Rng, scale: float) -> Effect:
    """First-order lag of the yaw rate."""
    tau = float(rng.uniform(0.08, 0.25)) * scale
    part = closing(tau)
    now = np.zeros(len(world.runs))

    def setpoint(v: Array, w: Array) -> Pair:
        nonlocal now
        now = now + part * (w - now)
        return v, now

    return Effect({"tau_s": tau}, setpoint=setpoint)


@cause("inside")
def steering_rate_limit(world: World, rng: Rng, scale: float) -> Effect:
    """Limit of the yaw acceleration; a larger scale is a lower limit."""
    limit = float(rng.uniform(2.0, 6.0)) / max(scale, 1e-9)
    most = limit * STEP_S
    now = np.zeros(len(world.runs))

    def setpoint(v: Array, w: Array) -> Pair:
        nonlocal now
        now = now + np.clip(w - now, -most, most)
        return v, now

    return Effect({"limit_rad_s2": limit}, setpoint=setpoint)


@cause("outside")
def speed_ripple(world: World, rng: Rng, scale: float) -> Effect:
    """Forward speed oscillates with the wheel's angle, whose start differs per run."""
    size = float(rng.uniform(0.04, 0.08)) * scale
    phase = rng.uniform(0.0, 2.0 * np.pi, len(world.runs))
    return Effect(
        {"amplitude": size},
        ground_speed=lambda v, s: v * (1.0 + size * np.sin(s.wheel_angle + phase)),
    )


@cause("outside")
def carpet_patch(world: World, rng: Rng, scale: float) -> Effect:
    """Lower speed within a disc of the floor."""
    loss = float(rng.uniform(0.1, 0.2)) * scale
    x, y = rng.uniform(-0.8, 0.8, 2).tolist()
    radius = float(rng.uniform(0.6, 0.9))

    def ground_speed(v: Array, s: State) -> Array:
        inside = radius - np.hypot(s.x - x, s.y - y)
        covered: Array = np.clip(0.5 + inside / 0.02, 0.0, 1.0)
        return v * (1.0 - loss * covered)

    return Effect({"loss": loss, "x_m": x, "y_m": y, "radius_m": radius}, ground_speed=ground_speed)


@cause("inside")
def wheel_diameter_mismatch(world: World, rng: Rng, scale: float) -> Effect:
    """Constant offset of the path's curvature."""
    curvature = signed(rng, 0.02, 0.08) * scale
    return Effect({"curvature_1_m": curvature}, yaw_rate=lambda w, v, s: w + curvature * v)


@cause("inside")
def lateral_slip(world: World, rng: Rng, scale: float) -> Effect:
    """Yaw rate lost to slip, growing with the square of the speed."""
    loss = min(float(rng.uniform(0.04, 0.12)) * scale, 0.9)
    speed = world.vehicle.speed
    top = float(np.abs(speed(np.array([speed.greatest, -speed.greatest]))).max())
    g = loss / (1.0 - loss) / top**2
    return Effect(
        {"g_s2_m2": g, "loss_at_top_speed": loss},
        yaw_rate=lambda w, v, s: w / (1.0 + g * v * v),
    )


@cause("outside")
def castor_kick(world: World, rng: Rng, scale: float) -> Effect:
    """Yaw disturbance while the castor turns, its direction random per manoeuvre."""
    turn = float(rng.uniform(0.05, 0.12)) * scale
    reach = float(rng.uniform(0.3, 0.6))
    names = sorted({r.manoeuvre.name for r in world.runs})
    way = dict(zip(names, rng.choice([-1.0, 1.0], len(names)).tolist(), strict=True))
    fade = reach / 3.0
    per_m = np.array([way[r.manoeuvre.name] for r in world.runs]) * turn / fade
    arm = world.vehicle.track_m
    return Effect(
        {"turn_rad": turn, "reach_m": reach, "direction": way},
        yaw_rate=lambda w, v, s: w + per_m * np.hypot(v, arm * w) * np.exp(-s.castor_m / fade),
    )


@cause("outside")
def yaw_by_position(world: World, rng: Rng, scale: float) -> Effect:
    """Yaw rate of a moving vehicle has a bias linear in x."""
    slope = signed(rng, 0.015, 0.04) * scale
    return Effect({"slope_rad_s_m": slope}, yaw_rate=lambda w, v, s: w + slope * s.x * s.moving)


@cause("inside")
def floor_tilt(world: World, rng: Rng, scale: float) -> Effect:
    """A moving vehicle drifts in a fixed direction of the floor."""
    size = float(rng.uniform(0.003, 0.008)) * scale
    way = float(rng.uniform(-np.pi, np.pi))
    vx, vy = size * math.cos(way), size * math.sin(way)
    return Effect({"speed_m_s": size, "direction_rad": way}, drift=lambda s: (vx * s.moving, vy * s.moving))


@cause("time")
def wind_half(world: World, rng: Rng, scale: float) -> Effect:
    """Drift of a moving vehicle in the second half of the campaign only."""
    size = float(rng.uniform(0.006, 0.012)) * scale
    way = float(rng.uniform(-np.pi, np.pi))
    since = 0.5 * world.length_s
    blows = (world.started > since).astype(float)
    vx, vy = size * math.cos(way) * blows, size * math.sin(way) * blows
    return Effect(
        {"speed_m_s": size, "direction_rad": way, "from_s": since},
        drift=lambda s: (vx * s.moving, vy * s.moving),
    )


@cause("outside")
def pull_to_point(world: World, rng: Rng, scale: float) -> Effect:
    """A moving vehicle drifts toward a point of the room."""
    size = float(rng.uniform(0.005, 0.010)) * scale
    x, y = rng.uniform(-1.0, 1.0, 2).tolist()

    def drift(s: State) -> Pair:
        dx, dy = x - s.x, y - s.y
        pull = size * s.moving / np.maximum(np.hypot(dx, dy), 0.1)
        return pull * dx, pull * dy

    return Effect({"speed_m_s": size, "x_m": x, "y_m": y}, drift=drift)


@cause("inside")
def marker_offset(world: World, rng: Rng, scale: float) -> Effect:
    """Marker centroid is off from the header, forward and left."""
    size = float(rng.uniform(0.010, 0.025)) * scale
    way = math.radians(float(rng.uniform(20.0, 70.0)) + 90.0 * float(rng.integers(4)))
    forward, left = size * math.cos(way), size * math.sin(way)
    return Effect(
        {"forward_m": forward, "left_m": left},
        marker=lambda clock: (np.full_like(clock, forward), np.full_like(clock, left)),
    )


@cause("time")
def bumped_marker(world: World, rng: Rng, scale: float) -> Effect:
    """Marker offset steps between two runs in the middle of the campaign."""
    size = float(rng.uniform(0.010, 0.025)) * scale
    way = float(rng.uniform(-np.pi, np.pi))
    wanted = float(rng.uniform(0.35, 0.65)) * world.length_s
    since = float(world.started[world.started >= wanted][0]) - LEAD_S - 1.0
    forward, left = size * math.cos(way), size * math.sin(way)
    return Effect(
        {"forward_m": forward, "left_m": left, "from_s": since},
        marker=lambda clock: (forward * (clock >= since), left * (clock >= since)),
    )


@cause("inside")
def mocap_latency(world: World, rng: Rng, scale: float) -> Effect:
    """A pose stamped t was true some time before."""
    latency = float(rng.uniform(0.03, 0.1)) * scale
    return Effect({"latency_s": latency}, latency_s=latency)


@cause("inside")
def heading_misalignment(world: World, rng: Rng, scale: float) -> Effect:
    """Measured heading has a constant offset."""
    offset = math.radians(signed(rng, 1.5, 4.0)) * scale
    return Effect({"offset_rad": offset}, measure=lambda x, y, heading: (x, y, heading + offset))


@cause("inside")
def mocap_scale(world: World, rng: Rng, scale: float) -> Effect:
    """Measured positions are scaled about the room's origin."""
    size = signed(rng, 0.015, 0.03) * scale
    factor = 1.0 + size
    return Effect({"scale_error": size}, measure=lambda x, y, heading: (x * factor, y * factor, heading))


def acting_commands(runs: list[Run], steps: int, delay_s: float) -> tuple[Array, Array]:
    """Mean acting commands of each step, shaped (steps, runs), shifted by the delay."""
    edges = np.arange(steps + 1) * STEP_S - delay_s
    out = np.empty((2, steps, len(runs)))
    for i, run in enumerate(runs):
        rows = run.manoeuvre.rows
        for k in (0, 1):
            total = np.concatenate([[0.0], np.cumsum(rows[:-1, k + 1] * np.diff(rows[:, 0]))])
            out[k, :, i] = np.diff(np.interp(edges, rows[:, 0], total)) / STEP_S
    return out[0], out[1]


def run_factors(world: World, seed: int) -> tuple[Array, Array]:
    """Factors of each run on the speed and on the yaw rate."""
    rng = stream(world.vehicle.number, seed, "scatter")
    scatter = rng.normal(0.0, 1.0, (2, len(world.runs)))
    car = world.vehicle
    return 1.0 + car.speed_scatter * scatter[0], 1.0 + car.yaw_scatter * scatter[1]


def integrate(world: World, seed: int, causes: list[Effect]) -> tuple[Array, Array]:
    """Times of the steps and axle poses (x, y, heading), shaped (3, steps + 1, runs)."""
    car, runs = world.vehicle, world.runs
    n = len(runs)
    steps = math.ceil((max(r.manoeuvre.stop_s for r in runs) + TAIL_S) / STEP_S) + 2
    drive, yaw = acting_commands(runs, steps, sum(c.delay_s for c in causes))
    for command in [c.command for c in causes if c.command]:
        drive, yaw = command(drive, yaw)
    speed_factor, yaw_factor = run_factors(world, seed)
    aim_v: Array = car.speed(drive) * speed_factor
    aim_w: Array = car.yaw(yaw) * yaw_factor
    clock = world.started[None, :] + np.arange(steps)[:, None] * STEP_S
    for target in [c.target for c in causes if c.target]:
        aim_v, aim_w = target(aim_v, aim_w, clock)
    setpoints = [c.setpoint for c in causes if c.setpoint]
    speeds = [c.ground_speed for c in causes if c.ground_speed]
    yaws = [c.yaw_rate for c in causes if c.yaw_rate]
    drifts = [c.drift for c in causes if c.drift]

    s = State(
        np.array([r.x_m for r in runs]),
        np.array([r.y_m for r in runs]),
        np.array([r.heading_rad for r in runs]),
        np.zeros(n), np.zeros(n), np.zeros(n),
    )  # fmt: skip
    out = np.empty((3, steps + 1, n))
    out[:, 0] = s.x, s.y, s.heading
    radius, half = car.wheel_radius_m, 0.5 * car.track_m
    part = closing(MOTOR_TAU_S)
    left, right, v0, w0 = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    for k in range(steps):
        v, w = aim_v[k], aim_w[k]
        for setpoint in setpoints:
            v, w = setpoint(v, w)
        left = left + part * ((v - half * w) / radius - left)
        right = right + part * ((v + half * w) / radius - right)
        v = 0.5 * radius * (left + right)
        w = radius * (right - left) / (2.0 * half)
        s.moving = np.minimum(radius / MOVING_M_S * np.maximum(np.abs(left), np.abs(right)), 1.0)
        s.wheel_angle = s.wheel_angle + v / radius * STEP_S
        for ground_speed in speeds:
            v = ground_speed(v, s)
        s.castor_m = s.castor_m + np.hypot(v, car.track_m * w) * STEP_S
        for yaw_rate in yaws:
            w = yaw_rate(w, v, s)
        turn = 0.5 * (w0 + w) * STEP_S
        middle = s.heading + 0.5 * turn
        ahead = 0.5 * (v0 + v) * STEP_S
        dx, dy = ahead * np.cos(middle), ahead * np.sin(middle)
        for drift in drifts:
            vx, vy = drift(s)
            dx, dy = dx + vx * STEP_S, dy + vy * STEP_S
        s.x, s.y, s.heading = s.x + dx, s.y + dy, s.heading + turn
        out[:, k + 1] = s.x, s.y, s.heading
        v0, w0 = v, w
    return np.arange(steps + 1) * STEP_S, out


def film(world: World, seed: int, causes: list[Effect]) -> pd.DataFrame:
    """Frames of the cameras for all runs."""
    car = world.vehicle
    times, poses = integrate(world, seed, causes)
    rng = stream(car.number, seed, "camera")
    phase = rng.random(len(world.runs))
    latency = sum(c.latency_s for c in causes)
    pieces: list[Array] = []
    ids: list[str] = []
    for i, run in enumerate(world.runs):
        span = LEAD_S + run.manoeuvre.stop_s + TAIL_S
        frame = np.arange(int(span * car.rate_hz - phase[i]) + 1)
        t = np.round(-LEAD_S + (frame + phase[i]) / car.rate_hz, 6)
        true = [np.interp(t - latency, times, poses[k, :, i]) for k in range(3)]
        pieces.append(np.stack([t, frame, run.started_s + t - latency, *true]))
        ids += [run.run_id] * len(t)
    t, frame, clock, x, y, heading = np.concatenate(pieces, axis=1)
    forward, side = np.full_like(t, car.axle_to_marker_m), np.zeros_like(t)
    for marker in [c.marker for c in causes if c.marker]:
        more_forward, more_left = marker(clock)
        forward, side = forward + more_forward, side + more_left
    c, s = np.cos(heading), np.sin(heading)
    x, y = x + c * forward - s * side, y + s * forward + c * side
    for measure in [c.measure for c in causes if c.measure]:
        x, y, heading = measure(x, y, heading)
    noise = rng.normal(0.0, 1.0, (3, len(t)))
    x, y = x + car.position_noise_m * noise[0], y + car.position_noise_m * noise[1]
    heading = heading + car.heading_noise_rad * noise[2]
    heading = np.arctan2(np.sin(heading), np.cos(heading))
    tracked = rng.random(len(t)) >= LOST_FRACTION
    x, y, heading = (np.where(tracked, a, np.nan) for a in (x, y, heading))
    return pd.DataFrame(
        {
            "run_id": ids, "t_s": t, "x_m": x, "y_m": y, "heading_rad": heading,
            "tracked": tracked, "frame": frame.astype(np.int64),
        }
    )  # fmt: skip


def write(folder: Path, number: int, names: list[str], scale: float, seed: int) -> None:
    """Write the campaign directory and the truth file beside it."""
    car = Vehicle.draw(number)
    world = World(car, plan(car, seed))
    causes = {
        name: draw(world, stream(number, seed, name), scale) for name, (_, draw) in CAUSES.items() if name in names
    }
    poses = film(world, seed, list(causes.values()))
    nan = float("nan")
    runs = pd.DataFrame(
        [
            {
                "run_id": r.run_id, "experiment": r.manoeuvre.experiment,
                "trajectory": r.manoeuvre.name, "condition": "", "repeat": r.repeat,
                "target_x_m": nan, "target_y_m": nan, "target_heading_rad": nan,
                "started_s": r.started_s, "status": "ok", "firmware": "sim",
            }
            for r in world.runs
        ]
    )  # fmt: skip
    rows = np.concatenate([r.manoeuvre.rows for r in world.runs])
    ids = [r.run_id for r in world.runs for _ in range(len(r.manoeuvre.rows))]
    commands = pd.DataFrame({"run_id": ids, "t_s": rows[:, 0], "drive": rows[:, 1], "front": rows[:, 2], "rear": 0.0})
    folder.mkdir(parents=True, exist_ok=True)
    runs.to_parquet(folder / "runs.parquet", index=False)
    commands.to_parquet(folder / "commands.parquet", index=False)
    poses.to_parquet(folder / "poses.parquet", index=False)
    (folder / "campaign.toml").write_text(
        f'schema = 3\nname = "wheels {number} evening {seed}"\n\n'
        f'[vehicle]\nname = "wheels {number}"\nkinematics = "differential"\n'
        f"rear_axle_m = {car.header_rear_axle_m:.5f}\n"
        'command_unit = "si"\nneutral = 0.0\n\n'
        f"[mocap]\nrate_hz = {car.rate_hz:.1f}\n"
    )
    truth = {
        "vehicle": number, "seed": seed, "scale": scale,
        "causes": {name: {"kind": CAUSES[name][0], **c.sizes} for name, c in causes.items()},
        "vehicle_parameters": asdict(car),
    }  # fmt: skip
    folder.with_name(folder.name + ".truth.json").write_text(json.dumps(truth, indent=2) + "\n")


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    orders = parser.add_subparsers(dest="order", required=True)
    orders.add_parser("list", help="print the causes and their kinds as JSON")
    order = orders.add_parser("write", help="write a campaign directory")
    order.add_argument("folder", type=Path)
    order.add_argument("--vehicle", type=int, default=1)
    order.add_argument("--causes", default="", help="comma-separated names")
    order.add_argument("--scale", type=float, default=1.0)
    order.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    if args.order == "list":
        print(json.dumps({name: kind for name, (kind, _) in CAUSES.items()}, indent=2))
        return
    names = [n.strip() for n in args.causes.split(",") if n.strip() and n.strip() != "none"]
    unknown = sorted(set(names) - set(CAUSES))
    if unknown:
        parser.error(f"unknown causes: {', '.join(unknown)}")
    write(args.folder.absolute(), args.vehicle, names, args.scale, args.seed)


if __name__ == "__main__":
    main()
