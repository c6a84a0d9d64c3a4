"""A vehicle of a few lines, independent of the package's model: what the diagnosis is tested on.

Semi-implicit Euler at 240 Hz from commands to poses, in the floor frame; every cause can be switched on.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from agvbench.campaign import CampaignHeader
from agvbench.types import NO_TARGET, Command, Commands, Frames, Pose, Run
from agvbench.vehicle.channels import Channels

FRONT_M, REAR_M, NEUTRAL = 0.181, 0.121, 1500.0
NEUTRAL_COMMAND = Command(NEUTRAL, NEUTRAL, NEUTRAL)
HEADER = CampaignHeader(
    schema=1,
    name="tiny",
    vehicle_name="tiny",
    front_axle_m=FRONT_M,
    rear_axle_m=REAR_M,
    channels=Channels.alike("us"),
    mocap_rate_hz=60.0,
)
_STEP_S = 1.0 / 240.0
_BEFORE_S, _AFTER_S = 0.4, 1.2


@dataclass
class InMemory:
    """A header and runs, as `diagnose` takes them."""

    runs: list[Run]
    header: CampaignHeader = HEADER

    def __iter__(self) -> Iterator[Run]:
        return iter(self.runs)


@dataclass(frozen=True)
class Tiny:
    """What is true of the vehicle; all zero is what free maps can describe."""

    delay_s: float = 0.0
    steering_lag_s: float = 0.0
    steering_inertia_s: float = 0.0
    rear_lag_ratio: float = 1.0
    play_rad: float = 0.0
    rear_play_ratio: float = 1.0
    friction_rad: float = 0.0
    friction_share: float = 0.3
    accelerate_s: float = 0.0
    brake_s: float = 0.0
    coast_s: float = 0.0
    coast_mps2: float = 0.0
    ramp_forward_mps2: float = 0.0
    ramp_backward_mps2: float = 0.0
    ramp_lag_s: float = 0.0
    is_ramp_of_force: bool = False
    drive_gap_m: float = 0.0
    spring_per_s2: float = 0.0
    relaxation_s: float = 0.5
    slip: float = 0.0
    droop_per_hour: float = 0.0
    battery_changed_h: float = math.inf
    cold_steering_lag_s: float = 0.0
    tilt_mps: float = 0.0
    tilt_rad: float = 0.0
    front_from_rear: float = 0.0
    rear_from_front: float = 0.0
    cornering_loss: float = 0.0
    overrun: float = 0.0
    has_differential: bool = False
    reverse_gain: float = 0.0
    axle_ratio: float = 0.0
    front_drive_share: float = 0.5
    warm_gain: float = 0.0
    warm_h: float = 0.4
    slow_patch: float = 0.0
    pull_mps: float = 0.0
    kick_rad: float = 0.0
    rub_loss: float = 0.0
    rub_from_rad: float = 0.3
    yields_s_per_m: float = 0.0
    sag_per_rad: float = 0.0
    step_creep: float = 0.0
    step_creep_s: float = 1.0
    sag_s: float = 0.6
    mixing_rad_s_per_m: float = 0.0
    dead_band: float = 0.0
    saver_slip_rad: float = 0.0
    saver_beyond: float = 150.0
    windup: float = 0.0
    gyro_s_per_m: float = 0.0
    axle_play_rad: float = 0.0
    supply_loss_s_per_m: float = 0.0
    supply_s: float = 1.5
    per_volt: float = 0.0
    reversal_pause_s: float = 0.0
    brake_turn_per_m: float = 0.0
    seam_rad: float = 0.0
    downhill: float = 0.0
    run_out_rad: float = 0.0
    slip_pivot_m: float = 0.0
    creep_s: float = 0.0
    wheelbase_m: float = FRONT_M + REAR_M
    marker_forward_m: float = 0.0
    speed_factor: float = 1.0
    steering_factor: float = 1.0
    front_trim_rad: float = 0.0
    is_preset: bool = False
    axle_scatter_rad: float = 0.001
    speed_scatter: float = 0.002
    noise_m: float = 3e-4
    noise_rad: float = 1e-3


def speed_of(command: float) -> float:
    off = NEUTRAL - command
    size = max(abs(off) - 40.0, 0.0)
    return math.copysign(min(0.32, 0.45 * size / (size + 120.0)), off) if size else 0.0


def front_of(command: float) -> float:
    return min(max(-0.0015 * (command - NEUTRAL) - 0.026, -0.72), 0.70)


def rear_of(command: float) -> float:
    return min(max(-0.00153 * (command - NEUTRAL) - 0.037, -0.68), 0.69)


class Electronics:
    """What is between the commands and the actuators: dead bands, a linkage that slips, a supply, a controller."""

    def __init__(self, tiny: Tiny) -> None:
        self.tiny, self.kept, self.slipped = tiny, [NEUTRAL, NEUTRAL], [0.0, 0.0]
        self.drawn, self.direction, self.paused_s = 0.0, 0.0, 0.0

    def obey(self, command: Command, commanded: float) -> tuple[list[float], float]:
        """Return the angles and the speed that the actuators aim at."""
        return self._steer((command.front, command.rear), commanded), self._drive(commanded)

    def _steer(self, commands: tuple[float, float], commanded: float) -> list[float]:
        for axle, command in enumerate(commands):
            if abs(command - self.kept[axle]) > self.tiny.dead_band:
                self.kept[axle] = command
            if abs(command - NEUTRAL) > self.tiny.saver_beyond:
                self.slipped[axle] = math.copysign(self.tiny.saver_slip_rad, command - NEUTRAL)
        angles = front_of(self.kept[0]), rear_of(self.kept[1])
        mixed = self.tiny.mixing_rad_s_per_m * commanded
        return [angle - slip + mixed for angle, slip in zip(angles, self.slipped, strict=True)]

    def _drive(self, commanded: float) -> float:
        self.drawn += (abs(commanded) - self.drawn) * _STEP_S / self.tiny.supply_s
        reverses = commanded * self.direction < 0.0
        self.paused_s = self.paused_s + _STEP_S if reverses else 0.0
        if reverses and self.paused_s < self.tiny.reversal_pause_s:
            return 0.0
        self.direction = commanded or self.direction
        return commanded * (1.0 - self.tiny.supply_loss_s_per_m * self.drawn)


SUPPLY_V = 12.0


def supply_v(t_s):
    """Return the voltage of the supply, which other loads change slowly."""
    return SUPPLY_V + 0.5 * np.sin(t_s / 7.0) + 0.2 * np.sin(t_s / 2.9)


def drive(tiny: Tiny, commands: Commands, start: Pose, started_s: float, rng: np.random.Generator) -> Frames:
    """Return 60 Hz frames of one run, from rest to rest."""
    f_off, r_off = rng.normal(0.0, tiny.axle_scatter_rad, 2)
    gain = 1.0 + rng.normal(0.0, tiny.speed_scatter)
    hours = started_s / 3600.0
    of_battery_h = hours if hours < tiny.battery_changed_h else hours - tiny.battery_changed_h
    gain *= tiny.speed_factor * (1.0 - tiny.droop_per_hour * of_battery_h)
    steering_lag_s = tiny.steering_lag_s + tiny.cold_steering_lag_s * math.exp(-hours / tiny.warm_h)
    warm = 1.0 + tiny.warm_gain * -math.expm1(-hours / tiny.warm_h)
    x, y, heading = start
    unmoved = commands.at(0) if tiny.is_preset else NEUTRAL_COMMAND
    front, rear, speed = front_of(unmoved.front) + f_off, rear_of(unmoved.rear) + r_off, 0.0
    turning, loose, driven, windup, gap_m = [0.0, 0.0], [front, rear], 0.0, 0.0, 0.0
    strained, crept = [(front, 0.0), (rear, 0.0)], [front, rear]
    load, before_asked = 0.0, (front_of(NEUTRAL), rear_of(NEUTRAL))
    electronics = Electronics(tiny)
    poses, times = [], []
    steps = round((commands.t_s[-1] + _AFTER_S + _BEFORE_S) / _STEP_S)
    for k in range(steps):
        t = k * _STEP_S - _BEFORE_S
        if k % 4 == 0:
            times.append(t)
            poses.append((x, y, heading))
        row = int(np.searchsorted(commands.t_s, t - tiny.delay_s + 1e-12, side="right")) - 1
        c = commands.at(row) if row >= 0 else unmoved
        commanded = speed_of(c.drive) * gain * (1.0 + tiny.per_volt * (supply_v(started_s + t) - SUPPLY_V))
        asked, commanded = electronics.obey(c, commanded)
        load = load * math.exp(-_STEP_S / tiny.sag_s) + sum(map(abs, np.subtract(asked, before_asked)))
        before_asked = asked
        gap_m = tiny.drive_gap_m if commanded == 0.0 else gap_m - abs(commanded) * _STEP_S
        commanded = 0.0 if gap_m > 0.0 else commanded
        lags = steering_lag_s, tiny.rear_lag_ratio * steering_lag_s
        away = [1.0 - math.exp(-_STEP_S / lag) if lag else 1.0 for lag in lags]
        was = front, rear, speed
        if tiny.steering_inertia_s:
            for axle, aim, at in ((0, asked[0] + f_off, front), (1, asked[1] + r_off, rear)):
                push = (aim - at - tiny.steering_lag_s * turning[axle]) / tiny.steering_inertia_s**2
                turning[axle] += push * _STEP_S
            front, rear = front + turning[0] * _STEP_S, rear + turning[1] * _STEP_S
        else:
            front += (asked[0] + f_off - front) * away[0]
            rear += (asked[1] + r_off - rear) * away[1]
        lag = (
            tiny.accelerate_s
            if abs(commanded) > abs(speed)
            else (tiny.coast_s if commanded == 0.0 else 0.0) or tiny.brake_s
        )
        # A limited force accelerates the body, which turned wheels drive slower than themselves.
        ahead = 0.5 * (math.cos(front) + math.cos(rear)) if tiny.is_ramp_of_force else 1.0
        speed, windup = driven_speed(tiny, commanded, lag, speed, windup, ahead)
        relief = 1.0 + tiny.reverse_gain if speed < 0.0 else 1.0
        f, r, s = (
            (old + new) / 2.0 if lagged else new
            for old, new, lagged in zip(was, (front, rear, speed), (steering_lag_s, steering_lag_s, lag), strict=True)
        )
        if tiny.play_rad:
            f, r = loose = [
                follow(loose[0], f, tiny.play_rad / 2.0),
                follow(loose[1], r, tiny.rear_play_ratio * tiny.play_rad / 2.0),
            ]
        if tiny.friction_rad:
            strained = [
                (servo, strain(tiny, before, servo - at)) for servo, (at, before) in zip((f, r), strained, strict=True)
            ]
            f, r = f - strained[0][1], r - strained[1][1]
        crept = [z + (angle - z) * _STEP_S / tiny.step_creep_s for z, angle in zip(crept, (f, r), strict=True)]
        f, r = (angle + tiny.step_creep * (angle - z) for z, angle in zip(crept, (f, r), strict=True))
        f += tiny.run_out_rad * math.sin(math.tau * driven / 0.8)
        f *= 1.0 + tiny.yields_s_per_m * (abs(s) - 0.2)
        f += tiny.windup * (heading - start[2])
        turns = s * (math.tan(f) - math.tan(r))
        f -= tiny.gyro_s_per_m * turns / (1.0 + tiny.gyro_s_per_m * s)
        r += tiny.axle_play_rad * math.tanh(s * turns / 0.01)
        df = (f + tiny.front_from_rear * r) * relief * warm * tiny.steering_factor + tiny.front_trim_rad
        dr = (r + tiny.rear_from_front * f) * relief * warm * tiny.steering_factor
        drag = tiny.cornering_loss * (abs(math.tan(df)) + abs(math.tan(dr)))
        v = s * (1.0 - drag) * (1.0 - tiny.sag_per_rad * load)
        v *= 1.0 - tiny.rub_loss * min(max((df - tiny.rub_from_rad) / 0.05, 0.0), 1.0)
        if math.hypot(x - 0.6, y - 0.3) < 0.7:
            v *= 1.0 - tiny.slow_patch
        v *= 1.0 + math.copysign(tiny.downhill, v) * math.cos(heading - 1.0)
        share = tiny.front_drive_share
        forward = v * (share * math.cos(df) + (1.0 - share) * (1.0 + tiny.axle_ratio) * math.cos(dr))
        if tiny.overrun:
            forward = balanced(s * math.cos(df), s * math.cos(dr), drag, tiny.overrun)
        if tiny.has_differential:
            forward = 2.0 * v / (1.0 / math.cos(df) + 1.0 / math.cos(dr))
        longer = 0.5 * (tiny.wheelbase_m - FRONT_M - REAR_M)
        front_m, rear_m = FRONT_M + longer - tiny.marker_forward_m, REAR_M + longer + tiny.marker_forward_m
        side = forward * (front_m * math.tan(dr) + rear_m * math.tan(df)) / tiny.wheelbase_m
        kinematic = forward * (math.tan(df) - math.tan(dr)) / tiny.wheelbase_m
        yaw = kinematic / (1.0 + tiny.slip * (forward**2 + side**2))
        side += (kinematic - yaw) * tiny.slip_pivot_m - tiny.creep_s * forward * yaw
        yaw += tiny.brake_turn_per_m * forward if commanded == 0.0 else 0.0
        middle = heading + yaw * _STEP_S / 2.0
        moving = 1.0 if abs(v) > 1e-3 else 0.0
        c_m, s_m = math.cos(middle), math.sin(middle)
        to_x, to_y = 0.3 - x, -0.2 - y
        pull = moving * tiny.pull_mps / math.hypot(to_x, to_y, 0.2)
        before = x * math.cos(0.7) + y * math.sin(0.7)
        x += (c_m * forward - s_m * side + moving * tiny.tilt_mps * math.cos(tiny.tilt_rad) + pull * to_x) * _STEP_S
        y += (s_m * forward + c_m * side + moving * tiny.tilt_mps * math.sin(tiny.tilt_rad) + pull * to_y) * _STEP_S
        heading += yaw * _STEP_S
        if (before > 0.2) != (x * math.cos(0.7) + y * math.sin(0.7) > 0.2):
            heading += tiny.seam_rad
        if driven == 0.0 and s != 0.0:
            heading += tiny.kick_rad
        driven += s * _STEP_S
    return seen(tiny, np.array(times), np.array(poses), rng)


def seen(tiny: Tiny, t_s: np.ndarray, p: np.ndarray, rng: np.random.Generator) -> Frames:
    """Return what a camera with noise says of poses (n, 3)."""
    n = len(p)
    p[:, :2] += rng.normal(0.0, tiny.noise_m, (n, 2))
    p[:, 2] += rng.normal(0.0, tiny.noise_rad, n)
    nan = np.full(n, np.nan)
    return Frames(t_s, p[:, 0], p[:, 1], p[:, 2], np.ones(n, dtype=bool), np.full(n, -1), nan, nan)


def driven_speed(
    tiny: Tiny, commanded: float, lag: float, speed: float, windup: float, ahead: float
) -> tuple[float, float]:
    """Return speed and windup of the drive train one step later; the ramp is that of the share `ahead` of the speed."""
    if commanded == 0.0 and tiny.spring_per_s2:
        speed -= (speed / tiny.coast_s + tiny.spring_per_s2 * windup) * _STEP_S
        return speed, windup + (speed - windup / tiny.relaxation_s) * _STEP_S
    if commanded == 0.0 and tiny.coast_mps2:
        return math.copysign(max(abs(speed) - tiny.coast_mps2 * _STEP_S, 0.0), speed), windup
    if commanded != 0.0 and tiny.ramp_forward_mps2:
        ramp = (tiny.ramp_forward_mps2 if commanded > 0.0 else tiny.ramp_backward_mps2) * _STEP_S / ahead
        closer = (commanded - speed) * (1.0 - math.exp(-_STEP_S / tiny.ramp_lag_s) if tiny.ramp_lag_s else 1.0)
        return speed + min(max(closer, -ramp), ramp), windup * (1.0 - _STEP_S / tiny.relaxation_s)
    return speed + (commanded - speed) * (1.0 - math.exp(-_STEP_S / lag) if lag else 1.0), windup


def balanced(front: float, rear: float, drag: float, overrun: float) -> float:
    """Return the speed at which the axles' forces balance the drag, where an axle brakes more stiffly than it pulls."""
    low, high = sorted((abs(front), abs(rear)))
    force = drag * (low + high)
    speed = ((1.0 + overrun) * low + high - force) / (2.0 + overrun)
    if speed < low:  # no axle brakes
        speed = (low + high - force) / 2.0
    return math.copysign(speed, front)


def follow(axle: float, servo: float, half: float) -> float:
    """Return where an axle with play of twice `half` comes to stand that its servo pulls along."""
    return min(max(axle, servo - half), servo + half)


def strain(tiny: Tiny, before: float, travel: float) -> float:
    """Return by how much a linkage with friction is strained after a `travel` of its servo, in steps of 0.1 mrad.

    The first step after a reversal is strained by a share of it, and the strain ends at its limit.
    """
    steps = max(1, math.ceil(abs(travel) / 1e-4))
    for _ in range(steps):
        stiffness = 0.5 * tiny.friction_share * (1.0 - math.copysign(before, before * travel) / tiny.friction_rad)
        before += stiffness * travel / steps
    return before


def held(drive_us: float, front: float, rear: float, seconds: float) -> Commands:
    return Commands(
        np.array([0.0, 0.4, 0.4 + seconds]),
        np.array([NEUTRAL, drive_us, NEUTRAL]),
        np.array([front, front, front]),
        np.array([rear, rear, rear]),
    )


def switched(drive_us: float, fronts: list[float], rears: list[float], seconds: float) -> Commands:
    t = [0.0, *(0.4 + seconds * np.arange(len(fronts))), 0.4 + seconds * len(fronts)]
    return Commands(
        np.array(t),
        np.array([NEUTRAL, *([drive_us] * len(fronts)), NEUTRAL]),
        np.array([fronts[0], *fronts, fronts[-1]]),
        np.array([rears[0], *rears, rears[-1]]),
    )


def reversed_drive(front: float, rear: float, drives_us: list[float], seconds: float) -> Commands:
    t = np.array([0.0, *(0.4 + seconds * np.arange(len(drives_us) + 1))])
    return Commands(t, np.array([NEUTRAL, *drives_us, NEUTRAL]), np.full(len(t), front), np.full(len(t), rear))


def experiments(  # noqa: PLR0912
    *, steps: bool = True, rear_steps: bool = False, small_steps: bool = False, reversals: bool = False
) -> Iterator[tuple[str, Commands, int]]:
    """Yield (experiment, commands, repeats) of a whole small campaign."""
    n = NEUTRAL
    levels = (1000.0, 1150.0, 1300.0, 1400.0, 1500.0, 1600.0, 1700.0, 1850.0, 2000.0)
    for c in levels:
        yield "steering_front", held(900.0, c, n, 4.0), 2
        yield "steering_rear", held(900.0, n, c, 4.0), 2
    for c in (1300.0, 1700.0):
        yield "steering_opposite", held(900.0, c, 3000.0 - c, 4.0), 2
        yield "steering_opposite", held(2100.0, c, 3000.0 - c, 4.0), 2
        yield "steering_opposite", held(900.0, c, c, 4.0), 2
    for c in (900.0, 1200.0, 1350.0, 1400.0, 1430.0, 1570.0, 1600.0, 1650.0, 1800.0, 2100.0):
        yield "drive", held(c, n, n, 4.0), 2
    for c in (1350.0, 1650.0):
        yield "trajectory", held(c, 1400.0, 1600.0, 5.0), 3
        yield "trajectory", held(c, 1600.0, 1400.0, 5.0), 3
    for c in (900.0, 2100.0):
        yield "trajectory", held(c, 1400.0, 1600.0, 5.0), 3
        yield "trajectory", held(c, 1600.0, 1400.0, 5.0), 3
    if steps:
        for c in (900.0, 2100.0, 1350.0):
            yield "step", switched(c, [1300.0, 1700.0, 1300.0, 1700.0, 1500.0], [n] * 5, 1.2), 3
            yield "step", switched(c, [1500.0, 1300.0, 1700.0, 1400.0], [1500.0, 1700.0, 1300.0, 1600.0], 1.5), 3
    if rear_steps:
        for c in (900.0, 2100.0):
            yield "step", switched(c, [n] * 5, [1300.0, 1700.0, 1300.0, 1700.0, 1500.0], 1.2), 3
    if small_steps:
        for c in (900.0, 2100.0):
            yield "small_step", switched(c, [1600.0, 1700.0, 1600.0, 1500.0, 1400.0, 1300.0], [n] * 6, 0.8), 3
            yield "small_step", switched(c, [n] * 6, [1400.0, 1300.0, 1400.0, 1500.0, 1600.0, 1700.0], 0.8), 3
    if reversals:
        for front, rear in ((n, n), (1300.0, 1700.0), (1700.0, 1300.0)):
            yield "reversal", reversed_drive(front, rear, [900.0, 2100.0, 900.0, 2100.0], 1.2), 3


def campaign_runs(tiny: Tiny, *, seed: int = 0, hours: float = 1.0, **which: bool) -> list[Run]:
    """Return a campaign of `experiments(**which)`: repeats interleaved, start poses at random."""
    return list(_driven(tiny, seed, hours, tuple(sorted(which.items()))))


@functools.cache
def _driven(tiny: Tiny, seed: int, hours: float, which: tuple[tuple[str, bool], ...]) -> tuple[Run, ...]:
    rng = np.random.default_rng(seed)
    plan = [
        (name, commands, repeat, k)
        for k, (name, commands, repeats) in enumerate(experiments(**dict(which)))
        for repeat in range(1, repeats + 1)
    ]
    plan.sort(key=lambda row: (row[2], rng.random()))
    runs = []
    for i, (name, commands, repeat, k) in enumerate(plan):
        started = 3600.0 * hours * i / len(plan)
        start = Pose(*rng.uniform(-0.7, 0.7, 2), rng.uniform(-math.pi, math.pi))
        frames = drive(tiny, commands, start, started, rng)
        runs.append(
            Run(
                f"{i:03d}-{name}-{k}",
                name,
                "",
                "calibrated",
                repeat,
                NO_TARGET,
                started,
                "ok",
                "tiny",
                commands,
                frames,
            )
        )
    return tuple(runs)
