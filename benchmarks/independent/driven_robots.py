"""Recordings of differential-drive and skid-steered robots, as other labs might have made them.

driven_robots.py write DIR --vehicle N    recordings, mapping.toml for `agvbench import`, and truth.json
driven_robots.py list [--vehicles N]      a line per vehicle

Contact forces (brush tyres in combined slip, castors that swivel with friction) act on a planar rigid body. Each side
has a motor, a gear with play and a wheel speed controller. The body's coordinates start from its centre of mass.
"""

import argparse
import json
import math
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace as Record
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numba import njit
from scipy.interpolate import CubicSpline
from scipy.linalg import null_space
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

DT = 2e-4  # s, step of the integration; the true pose is kept every fifth step
G = 9.81
X, Y, YAW, VX, VY, RATE = range(6)  # of the state; from here two each, for left and right:
WHEEL, MOTOR, TWIST, INTEGRAL, REF, DUTY, ACC, SPEED, CMD, AGE = range(6, 26, 2)
HEAD, SWIVEL, SWIVEL_RATE, STATES = 25, 26, 30, 34  # next command; up to four castors
Span = tuple[int, int]


class Plant(NamedTuple):
    """The numbers that the integrator needs; wheels: x, y, side, radius; castors: x, y, trail."""

    mass: float
    yaw_inertia: float
    wheels: np.ndarray
    castors: np.ndarray
    load: np.ndarray  # per contact: at rest, per m/s² forward, per m/s² to the left
    grip: tuple[float, ...]  # friction along and across, stiffness along and across, creep speed
    rolling: tuple[float, ...]  # coefficients of wheels and of castors
    terrain: tuple[float, ...]  # slope x, slope y, crown, slope of waves, wave number, patches
    inertia: tuple[float, ...]  # wheel and motor, of one side
    gear: tuple[float, ...]  # stiffness, damping, play
    friction: tuple[float, ...]  # left, right, viscous
    motor: tuple[float, ...]  # stall torque, limit, speed without load, supply, sag
    swivel: tuple[float, ...]  # friction per load, inertia
    mode: tuple[int, bool, bool]  # index in DRIVES; commands are of the body; saturation scales both wheels
    period: int  # steps per run of the controller
    gains: tuple[float, ...]  # feed-forward, proportional, integral, anti-windup
    model: tuple[float, ...]  # track and wheel radius in the firmware
    ramp: tuple[float, ...]  # acceleration, deceleration, yaw acceleration, largest wheel speed
    watchdog: float
    encoder: tuple[float, ...]  # share of a new value in the filtered speed, resolution


@njit(cache=True)
def approach(value: float, target: float, up: float, down: float) -> float:
    step = up if abs(target) > abs(value) and target * value >= 0 else down
    return value + min(max(target - value, -step), step)


@njit(cache=True)
def control(s: np.ndarray, p: Plant) -> None:
    """Run the firmware once: watchdog, ramps, kinematics, saturation, and a PI with feed-forward for each wheel."""
    dt = p.period * DT
    s[AGE] += dt
    alive = s[AGE] <= p.watchdog
    mode, body, scale_both = p.mode
    up, down, yaw_up, top = p.ramp
    for i in range(2):
        target = s[CMD + i] if alive else 0.0
        if body and i == 1:
            s[REF + 1] = approach(s[REF + 1], target, yaw_up * dt, yaw_up * dt)
        else:
            s[REF + i] = approach(s[REF + i], target, up * dt, down * dt)
    left, right = s[REF], s[REF + 1]
    if body:
        half = 0.5 * p.model[0] * s[REF + 1]
        left, right = s[REF] - half, s[REF] + half
    peak = max(abs(left), abs(right))
    if peak > top:
        if scale_both:
            left, right = left * top / peak, right * top / peak
        else:
            left, right = min(max(left, -top), top), min(max(right, -top), top)
    share, resolution = p.encoder
    forward, proportional, integral, windup = p.gains
    for i in range(2):
        ref = (left if i == 0 else right) / p.model[1]
        s[SPEED + i] += share * (round(s[MOTOR + i] / resolution) * resolution - s[SPEED + i])
        if mode == 2:
            s[DUTY + i] = min(max(forward * ref, -1.0), 1.0)
            continue
        error = ref - s[SPEED + i]
        wish = forward * ref + proportional * error + s[INTEGRAL + i]
        duty = min(max(wish, -1.0), 1.0)
        s[INTEGRAL + i] += integral * dt * (error + windup * (duty - wish) / proportional)
        s[DUTY + i] = duty


@njit(cache=True)
def brush(slip: float) -> float:
    """Return the share of the friction limit that a brush tyre uses, divided by its normalised slip."""
    return 1 - slip / 3 + slip * slip / 27 if slip < 3 else 1 / slip


@njit(cache=True)
def step(s: np.ndarray, p: Plant) -> None:
    """Integrate by DT; stiff friction of wheels, motors and castors is treated implicitly."""
    vx, vy, rate = s[VX], s[VY], s[RATE]
    cos, sin = math.cos(s[YAW]), math.sin(s[YAW])
    slope_x, slope_y, crown, wave, number, patches = p.terrain
    down_x = -G * (slope_x + wave * math.sin(number * s[X] + 0.6 * number * s[Y]))
    down_y = -G * (slope_y - 2 * crown * s[Y] + wave * math.sin(number * s[Y] - 0.4 * number * s[X] + 1))
    gx, gy = cos * down_x + sin * down_y, -sin * down_x + cos * down_y
    patch = 1 + patches * math.sin(0.7 * number * s[X]) * math.sin(0.5 * number * s[Y] + 2)
    along, across, stiff_x, stiff_y, creep = p.grip
    fx, fy, moment = p.mass * gx, p.mass * gy, 0.0
    wheels = len(p.wheels)
    torque, damping = np.zeros(2), np.zeros(2)
    for i in range(wheels):
        px, py, side, radius = p.wheels[i]
        j = int(side)
        load = max(p.load[i, 0] + p.load[i, 1] * s[ACC] + p.load[i, 2] * s[ACC + 1], 0.0)
        speed = s[WHEEL + j] * radius
        reference = abs(speed) + creep
        kx, ky = stiff_x * (vx - rate * py - speed) / reference, stiff_y * (vy + rate * px) / reference
        share = load * patch * brush(math.hypot(kx, ky))
        force_x, force_y = -along * share * kx, -across * share * ky
        fx, fy, moment = fx + force_x, fy + force_y, moment + px * force_y - py * force_x
        roll = math.tanh(speed / 0.01)
        torque[j] -= force_x * radius + p.rolling[0] * load * radius * roll
        damping[j] += (
            radius * radius * (along * share * stiff_x / reference + p.rolling[0] * load * (1 - roll**2) / 0.01)
        )
    for i in range(len(p.castors)):
        qx, qy, trail = p.castors[i]
        row = wheels + i
        load = max(p.load[row, 0] + p.load[row, 1] * s[ACC] + p.load[row, 2] * s[ACC + 1], 0.0)
        cs, sn = math.cos(s[SWIVEL + i]), math.sin(s[SWIVEL + i])
        ux, uy, turn = vx - rate * qy, vy + rate * qx, s[SWIVEL_RATE + i]
        lateral, rolled = cs * uy - sn * ux - (rate + turn) * trail, cs * ux + sn * uy
        reference = abs(rolled) + creep
        share = across * load * brush(stiff_y * abs(lateral) / reference) * stiff_y / reference
        side_force, drag = -share * lateral, -p.rolling[1] * load * math.tanh(rolled / 0.02)
        grip = math.tanh(turn / 0.1)
        held = p.swivel[0] * load * trail
        slope = trail * trail * share + held * (1 - grip * grip) / 0.1
        s[SWIVEL_RATE + i] += DT * (-trail * side_force - held * grip) / (p.swivel[1] + DT * slope)
        s[SWIVEL + i] += DT * s[SWIVEL_RATE + i]
        force_x, force_y = drag * cs - side_force * sn, drag * sn + side_force * cs
        fx, fy, moment = fx + force_x, fy + force_y, moment + qx * force_y - qy * force_x + held * grip
    stall, limit, free, supply, sag = p.motor
    stiffness, gear_damping, play = p.gear
    for i in range(2):
        wheel, motor, twist = s[WHEEL + i], s[MOTOR + i], s[TWIST + i]
        left_over = abs(twist) - play / 2
        gear, engaged = 0.0, 0.0
        if left_over > 0:
            gear = math.copysign(stiffness * left_over, twist) + gear_damping * (motor - wheel)
            engaged = gear_damping
            if gear * twist < 0:
                gear = engaged = 0.0
        volts = supply - sag * (abs(s[DUTY]) + abs(s[DUTY + 1]))
        emf = motor / free
        if p.mode[0] == 1:
            drive = min(max(s[DUTY + i] * limit, -stall * (volts + emf)), stall * (volts - emf))
        else:
            drive = min(max(stall * (s[DUTY + i] * volts - emf), -limit), limit)
        rub = math.tanh(motor / 0.1)
        rubbing = p.friction[i] * rub + p.friction[2] * motor
        slope = engaged + p.friction[i] * (1 - rub * rub) / 0.1 + p.friction[2] + stall / free
        s[WHEEL + i] += DT * (gear + torque[i]) / (p.inertia[0] + DT * (damping[i] + engaged))
        s[MOTOR + i] += DT * (drive - gear - rubbing) / (p.inertia[1] + DT * slope)
        s[TWIST + i] += DT * (s[MOTOR + i] - s[WHEEL + i])
    ax, ay = fx / p.mass, fy / p.mass
    s[ACC] += DT / 0.05 * (ax - gx - s[ACC])  # the chassis settles on its springs within 50 ms
    s[ACC + 1] += DT / 0.05 * (ay - gy - s[ACC + 1])
    s[VX] += DT * (ax + rate * vy)
    s[VY] += DT * (ay - rate * vx)
    s[RATE] += DT * moment / p.yaw_inertia
    s[X] += DT * (cos * s[VX] - sin * s[VY])
    s[Y] += DT * (sin * s[VX] + cos * s[VY])
    s[YAW] += DT * s[RATE]


@njit(cache=True)
def advance(s: np.ndarray, p: Plant, span: Span, arrivals: np.ndarray, sent: np.ndarray, track: np.ndarray) -> None:
    """Integrate a span of steps, take commands as they arrive, and keep the pose every millisecond."""
    for k in range(span[0], span[1]):
        while s[HEAD] < len(arrivals) and arrivals[int(s[HEAD])] <= k * DT:
            command = sent[int(s[HEAD])]
            if not np.isnan(command[0]):
                s[CMD], s[CMD + 1], s[AGE] = command[0], command[1], 0.0
            s[HEAD] += 1
        if k % p.period == 0:
            control(s, p)
        if k % 5 == 0:
            track[k // 5, 0], track[k // 5, 1], track[k // 5, 2] = s[X], s[Y], s[YAW]
        step(s, p)


# share, mass kg, track m, radius/track, speed m/s, yaw rate rad/s, acceleration m/s², bandwidth rad/s, grounds, eyes
KINDS = """
lab robot           |.28| .6 4  | .09 .22 |.18 .25| .2 .6|1.5 3.5|1 3   |8 25|lab,carpet|mocap,camera
service robot       |.16| 6 40  | .25 .45 |.18 .26|.5 1.2|1 2.5  |.8 2  |6 18|lab,carpet|mocap,lidar
warehouse AGV       |.20| 60 350| .42 .70 |.13 .20|.8 1.6|.6 1.3 |.5 1.2|4 12|epoxy|lidar
skid-steered robot  |.16| 50 120| .40 .65 |.20 .32|.8 2  |.8 2   |1 3   |5 15|epoxy,asphalt,grass|lidar,mocap
skid-steered vehicle|.20|150 600| .80 1.25|.20 .28|1.5 3 |.7 1.6 |1 3   |4 12|asphalt,grass,gravel,snow|gnss,lidar
"""
# friction, slip stiffness, rolling resistance, patchiness, waviness (slope)
SURFACES: dict[str, tuple[float, ...]] = {
    "lab": (0.6, 0.9, 12, 25, 0.008, 0.02, 0.02, 0.001),
    "carpet": (0.7, 0.9, 8, 14, 0.02, 0.05, 0.05, 0.001),
    "epoxy": (0.5, 0.8, 15, 25, 0.008, 0.015, 0.05, 0.002),
    "asphalt": (0.65, 0.9, 10, 18, 0.012, 0.025, 0.05, 0.005),
    "grass": (0.4, 0.65, 5, 9, 0.05, 0.1, 0.15, 0.02),
    "gravel": (0.45, 0.65, 5, 8, 0.03, 0.06, 0.15, 0.012),
    "snow": (0.2, 0.35, 4, 8, 0.04, 0.08, 0.2, 0.015),
}
# frames per second, noise of position [m] and heading [rad], latency [s]
TRACKERS: dict[str, tuple[float, ...]] = {
    "mocap": (50, 200, 0.0002, 0.001, 0.0005, 0.002, 0.003, 0.03),
    "camera": (15, 60, 0.001, 0.005, 0.003, 0.008, 0.03, 0.12),
    "lidar": (5, 40, 0.004, 0.02, 0.001, 0.008, 0.04, 0.25),
    "gnss": (10, 100, 0.008, 0.02, 0.002, 0.006, 0.02, 0.1),
}
DRIVES = ("voltage, PI and feed-forward", "torque, PI and feed-forward", "voltage, open loop")
INTERFACES = ("body si", "wheels m/s", "wheels rad/s", "body normalised", "wheels normalised")
STYLES = ("steps", "joystick", "waypoints", "spins", "square", "stop_go", "reversing")
NOTES = (
    "Positions in m from the middle between the wheels: x forward, y left. Castors: x, y, trail; mass: x, y, height.",
    "command_full_scale: m/s and rad/s (body) or m/s of each wheel at a command of one. Ramp: m/s², m/s², rad/s².",
    "Command latency: from its stamp to its arrival in the firmware; localisation: from the pose to its stamp.",
    "clock_offset_s is added to the stamps of poses; the stamps of commands are right. Rest of units: as named.",
    "Torques, inertias: of one side, at the wheel, at nominal supply. Sag: share of the supply per side at full duty.",
    "Brush tyres: stiffness per slip, of friction times load. Height of the ground: slope, -crown y², and waves.",
    "Files: joined, a row per pose with the last command; merged, rows of poses and of commands; table, logger rows.",
)


def draw(seed: int) -> tuple[Record, list[Record], list[Record]]:
    """Draw a vehicle, its days and its recordings."""
    rng = np.random.default_rng([20, 53, seed])

    def u(low: float, high: float) -> float:
        return float(f"{rng.uniform(low, high):.5g}")

    def lg(low: float, high: float) -> float:
        return float(f"{math.exp(rng.uniform(math.log(low), math.log(high))):.5g}")

    def chance(p: float) -> bool:
        return bool(rng.random() < p)

    def pick(options: Any, p: Any = None) -> Any:
        return list(options)[int(rng.choice(len(options), p=p))]

    rows = [[cell.strip() for cell in line.split("|")] for line in KINDS.strip().splitlines()]
    shares = np.cumsum([float(row[1]) for row in rows])
    kind = rows[int(np.searchsorted(shares, (0.618034 * seed) % 1))]  # even shares in any series of seeds
    spans = [tuple(map(float, cell.split())) for cell in kind[2:9]]
    mass, track, speed, yaw, acc = lg(*spans[0]), lg(*spans[1]), u(*spans[3]), u(*spans[4]), u(*spans[5])
    radius, top, skid = track * u(*spans[2]), speed * u(1, 1.3), kind[0].startswith("skid")
    v = Record(seed=seed, kind=kind[0], mass_kg=mass, track_m=track, wheel_radius_m=radius, skid_steered=skid)
    v.largest_speed_m_per_s, v.largest_yaw_rate_rad_per_s = speed, yaw
    v.yaw_inertia_kg_m2, v.wheelbase_m = mass * track**2 * u(0.18, 0.32), track * u(0.6, 0.9) if skid else 0.0
    v.radius_right_over_left = 1 + float(rng.normal(0, 0.008 if skid else 0.005))
    if skid:
        limit, castors = 0.4 * mass * G * radius * u(0.85, 1.5), []
        v.centre_of_mass_m = v.wheelbase_m * u(-0.15, 0.15), track * u(-0.04, 0.04), track * u(0.2, 0.4)
    else:
        limit, reach = mass / 2 * radius * (acc * u(1.3, 2.5) + 0.06 * G), u(0.45, 0.9)
        out, trail = u(0.25, 0.45), lg(0.04, 0.1)
        places = pick((((-1, 0),), ((1, 0),), ((1, 0), (-1, 0)), ((-1, 1), (-1, -1))))
        castors = [(a * reach * track, b * out * track, trail * track) for a, b in places]
        ahead = float(np.mean([c[0] for c in castors])) or track * u(-0.3, 0.3)
        v.centre_of_mass_m = ahead * u(0.1, 0.35), track * u(-0.05, 0.05), track * u(0.2, 0.5)
    v.castors_m, v.castor_swivel_friction, v.castor_rolling_coefficient = castors, lg(0.01, 0.12), u(0.01, 0.04)
    v.grip_across_over_along, v.stiffness_across_over_along, v.uneven_load = u(0.7, 1), u(0.6, 1), u(-0.1, 0.1)
    # drive and firmware
    v.interface = pick(INTERFACES, (0.56, 0.12, 0.1, 0.12, 0.1))
    open_loop = v.interface == "wheels normalised" and mass < 50 and chance(0.7)
    v.drive = DRIVES[2] if open_loop else DRIVES[int(chance(0.7 if mass > 100 else 0.2))]
    v.torque_limit_n_m, v.stall_torque_n_m = limit, limit * u(1.2, 2.5) * (1 + open_loop)
    v.free_speed_rad_per_s = top / radius * u(1.15, 1.5)
    v.wheel_inertia_kg_m2 = mass / 2 * radius**2 * u(0.02, 0.04) * (2 if skid else 1)
    v.motor_inertia_kg_m2 = mass / 2 * radius**2 * lg(0.1, 0.8)
    v.motor_against_gear_hz, v.gear_play_rad = u(25, 60), lg(0.005, 0.05) if chance(0.4) else 0.0
    rub = limit * u(0.02, 0.1)
    v.friction_torque_left_right_n_m = rub * u(0.7, 1.3), rub * u(0.7, 1.3)
    v.viscous_friction_n_m_s, v.supply_sag = u(0, 0.05) * limit * radius / top, u(0, 0.05)
    v.controller_period_s, v.anti_windup = pick((0.001, 0.002, 0.005, 0.01)), u(0.5, 1)
    v.feed_forward_scale = pick((0.0, u(0.8, 1.1), u(0.8, 1.1)))
    v.integral_rate_per_s = lg(1, 6) if v.feed_forward_scale else lg(2.5, 8)
    v.encoder_time_constant_s, v.encoder_resolution_rad_per_s = u(0, 0.004), top / radius * lg(1e-4, 5e-3)
    light = v.motor_inertia_kg_m2 / (mass / 2 * radius**2)  # the loop must be stable while a wheel slips, too
    stable = 0.5 * light / (v.controller_period_s + 2 * v.encoder_time_constant_s)
    v.controller_bandwidth_rad_per_s = min(lg(*spans[6]), stable)
    v.firmware_track_m = track * (u(1, 1.7) if skid else u(0.98, 1.02))
    v.firmware_radius_m, v.saturation_scales_both = radius * u(0.97, 1.03), chance(0.5)
    v.wheel_speed_limit_m_per_s = top
    v.ramp = (acc * u(0.5, 1), acc * u(0.7, 1.5), 2 * acc / track * u(0.3, 1)) if chance(0.7) else (1e9,) * 3
    # commands
    wheel_scale = v.free_speed_rad_per_s * v.firmware_radius_m if open_loop else top
    scales = {"body si": (1.0, 1.0), "wheels m/s": (1.0, 1.0), "wheels rad/s": (v.firmware_radius_m,) * 2}
    scales |= {"body normalised": (speed * u(1, 1.2), yaw * u(1, 1.3)), "wheels normalised": (wheel_scale,) * 2}
    v.command_full_scale, v.command_rate_hz = scales[v.interface], pick((10.0, 20.0, 25.0, 50.0))
    v.command_dead_zone = u(0.02, 0.08) if "normalised" in v.interface and chance(0.5) else 0.0
    slower = [r for r in (10.0, 20.0, 25.0, 50.0) if v.command_rate_hz % r == 0]
    v.logger_rate_hz = v.command_rate_hz if chance(0.75) else pick(slower)
    v.command_latency_s, v.latency_jitter_s, v.watchdog_s = lg(0.02, 0.6), lg(0.0005, 0.02), u(0.3, 1)
    v.commands_lost = u(0.002, 0.03) if chance(0.25) else 0.0
    # room and localisation
    half = max(speed * u(4, 9), 6 * track)
    v.room_half_m, v.tracker = (half, half * u(0.5, 1)), pick(kind[10].split(","))
    eyes = TRACKERS[v.tracker]
    v.frame_rate_hz, v.noise_m_rad = float(round(lg(*eyes[:2]))), (lg(*eyes[2:4]), lg(*eyes[4:6]))
    v.frame_jitter, v.noise_drift_share = pick((0, u(0, 0.05), u(0, 0.2))), u(0, 0.7) if eyes[0] < 15 else 0.0
    v.localisation_latency_s = 0.0 if chance(0.4) else u(*eyes[6:])
    v.pose_filter, v.filter_s = pick(("none", "causal low-pass", "centred mean"), (0.7, 0.15, 0.15)), u(0.04, 0.2)
    v.frames_lost, v.frames_repeated = u(0, 0.05) if chance(0.4) else 0.0, u(0.005, 0.05) if chance(0.2) else 0.0
    v.gaps_per_minute, v.millimetres_and_degrees = u(0.5, 4) if chance(0.35) else 0.0, chance(0.35)
    fast = v.frame_rate_hz >= v.logger_rate_hz
    v.file = pick(("joined", "merged", "table"), (0.6, 0.2, 0.2) if fast else (0, 1, 0))
    v.time_unit = pick(("s", "ms", "ns"))

    days, date, surface = [], datetime(2024, 2, 1, 9, tzinfo=UTC) + timedelta(days=u(0, 300)), ""
    differ, offsets, sloping = chance(0.35), chance(0.2), chance(0.5 if skid else 0.15)
    slope, crown = rng.normal(0, 0.015, 2).tolist() if sloping else [0.0, 0.0], u(0, 0.02 / half) if sloping else 0.0
    marker = track * u(-0.5, 0.5), track * u(-0.03, 0.03)
    for i in range(pick((2, 2, 3))):
        if differ or i == 0:
            surface = pick(kind[9].split(","))
            g = SURFACES[surface]
            ground = u(*g[:2]), u(*g[2:4]), u(*g[4:6])
        d = Record(date=date.strftime("%Y-%m-%d"), start_unix_s=round(date.timestamp()), surface=surface)
        d.friction, d.slip_stiffness, d.rolling_coefficient = (value * u(0.95, 1.05) for value in ground)
        d.creep_speed_m_per_s, d.friction_patches = min(max(0.1 * speed, 0.04), 0.12), g[6]
        d.slope_x_y, d.crown_per_m, d.waves_slope, d.waves_length_m = slope, crown, g[7] * u(0.3, 1), half * u(0.1, 0.5)
        d.payload_kg, d.supply_of_nominal = mass * u(0.05, 0.4) if chance(0.15) else 0.0, u(0.95, 1.05)
        d.wheel_radius_scale, d.marker_heading_rad = 1 + rng.normal(0, 0.008 if skid else 0.001), rng.normal(0, 0.015)
        d.marker_m = marker[0] + rng.normal(0, 0.004 * track), marker[1] + rng.normal(0, 0.004 * track)
        d.clock_offset_s = u(-0.2, 0.2) if offsets else 0.0
        days.append(d)
        date += timedelta(days=int(rng.integers(1, 20)))
    count, pool = pick((3, 4, 5)), rng.permutation(STYLES)[: pick((1, 2, 3, 3))].tolist()
    pool += ["steps"] if pool == ["spins"] else []
    lengths = np.exp(rng.uniform(math.log(60), math.log(300), count))
    lengths = np.maximum(lengths * min(1, 700 / lengths.sum()), 60).round(1)
    recordings: list[Record] = []
    for i, n in enumerate(sorted([*range(len(days)), *rng.integers(0, len(days), count - len(days)).tolist()])):
        same = [r for r in recordings if r.day == n]
        r = Record(name=f"{days[n].date}_{'abcde'[len(same)]}", day=n, style=pool[i % len(pool)], seed=100 * seed + i)
        r.length_s, r.briskness = float(lengths[i]), u(0.5, 0.95)
        r.supply_of_nominal = days[n].supply_of_nominal - 0.02 * len(same)
        r.start_unix_s = days[n].start_unix_s + 900 * len(same)
        recordings.append(r)
    return v, days, recordings


def shifted(poses: np.ndarray, x: float, y: float) -> np.ndarray:
    """Return the poses of another point of the body."""
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return poses + np.column_stack([cos * x - sin * y, sin * x + cos * y, 0 * cos])


def plant(v: Record, day: Record, r: Record) -> Plant:
    """Translate a vehicle on a day into the numbers of the integrator."""
    cx, cy, height = v.centre_of_mass_m
    radius, ratio = v.wheel_radius_m * day.wheel_radius_scale, v.radius_right_over_left
    mass, trail = v.mass_kg + day.payload_kg, v.castors_m[0][2] if v.castors_m else 0.0
    axles = (v.wheelbase_m / 2, -v.wheelbase_m / 2) if v.skid_steered else (0.0,)
    sides = ((0, v.track_m / 2, 2 * radius / (1 + ratio)), (1, -v.track_m / 2, 2 * radius * ratio / (1 + ratio)))
    wheels = np.array([(x - cx, y - cy, side, size) for x in axles for side, y, size in sides])
    castors = np.array([(x - cx, y - cy, trail) for x, y, trail in v.castors_m]).reshape(-1, 3)
    balance = np.vstack([np.ones(len(wheels) + len(castors)), np.vstack([wheels[:, :2], castors[:, :2]]).T])
    load = np.linalg.pinv(balance) @ (mass * np.array([[G, 0, 0], [0, -height, 0], [0, 0, -height]]))
    warp = null_space(balance)  # an uneven floor shifts load between the diagonals
    load[:, 0] += v.uneven_load * mass * G / 4 * warp[:, 0] if warp.size else 0
    mode, smaller = DRIVES.index(v.drive), min(v.wheel_inertia_kg_m2, v.motor_inertia_kg_m2)
    gear = v.motor_inertia_kg_m2 * (2 * math.pi * v.motor_against_gear_hz) ** 2
    gear = min(gear, v.wheel_inertia_kg_m2 * (2 * math.pi * 120) ** 2)
    whole = v.wheel_inertia_kg_m2 + v.motor_inertia_kg_m2 + v.mass_kg / 2 * v.wheel_radius_m**2
    unit = v.torque_limit_n_m if mode == 1 else v.stall_torque_n_m
    proportional = v.controller_bandwidth_rad_per_s * whole / unit
    forward = (v.feed_forward_scale, 0.1 * v.feed_forward_scale, 1.0)[mode] / v.free_speed_rad_per_s
    filtering = v.controller_period_s / (v.controller_period_s + v.encoder_time_constant_s)
    number = 2 * math.pi / day.waves_length_m
    across, stiff_across = v.grip_across_over_along, v.stiffness_across_over_along
    mu, stiff, rolling = day.friction, day.slip_stiffness, day.rolling_coefficient
    return Plant(
        mass=mass,
        yaw_inertia=v.yaw_inertia_kg_m2 * mass / v.mass_kg,
        wheels=wheels,
        castors=castors,
        load=load,
        grip=(mu, mu * across, stiff, stiff * stiff_across, day.creep_speed_m_per_s),
        rolling=(rolling, rolling + v.castor_rolling_coefficient),
        terrain=(*day.slope_x_y, day.crown_per_m, day.waves_slope, number, day.friction_patches),
        inertia=(v.wheel_inertia_kg_m2, v.motor_inertia_kg_m2),
        gear=(gear, 0.6 * math.sqrt(gear * smaller), v.gear_play_rad),
        friction=(*v.friction_torque_left_right_n_m, v.viscous_friction_n_m_s),
        motor=(v.stall_torque_n_m, v.torque_limit_n_m, v.free_speed_rad_per_s, r.supply_of_nominal, v.supply_sag),
        swivel=(v.castor_swivel_friction, 0.003 * v.mass_kg * trail**2),
        mode=(mode, v.interface.startswith("body"), v.saturation_scales_both),
        period=round(v.controller_period_s / DT),
        gains=(forward, proportional, v.integral_rate_per_s * proportional, v.anti_windup),
        model=(v.firmware_track_m, v.firmware_radius_m),
        ramp=(*v.ramp, v.wheel_speed_limit_m_per_s),
        watchdog=v.watchdog_s,
        encoder=(filtering, v.encoder_resolution_rad_per_s),
    )


Commands = Iterator[tuple[float, float]]


class Driver:
    """Whoever drives: a style, and a return towards the middle where the room ends."""

    def __init__(self, v: Record, r: Record, rng: np.random.Generator) -> None:
        self.u, self.rng, self.tick, self.t = rng.uniform, rng, 1 / v.command_rate_hz, 0.0
        self.speed, self.yaw = r.briskness * v.largest_speed_m_per_s, r.briskness * v.largest_yaw_rate_rad_per_s
        self.half, self.home = np.array(v.room_half_m), np.zeros(2)
        self.brake = 0.4 * min(v.ramp[1], v.torque_limit_n_m * 2 / v.mass_kg / v.wheel_radius_m, 2.0)
        self.lag = v.command_latency_s + 0.2
        full = v.command_full_scale[1] if "body" in v.interface else 2 * v.command_full_scale[0] / v.track_m
        self.least = max(0.15 * self.yaw, 1.3 * v.command_dead_zone * full)
        self.gain = 0.6 / (self.lag + 0.2 + self.yaw / v.ramp[2])
        self.pose, self.pace, self.returning = np.zeros(3), np.zeros(2), False
        self.plan: Commands = getattr(self, r.style)()

    def __call__(self, t: float, pose: np.ndarray, pace: np.ndarray) -> tuple[float, float]:
        self.t, self.pose, self.pace = t, pose, pace
        way = self.lag + 0.3 + np.hypot(*pace) / (2 * self.brake)
        there = np.abs(pose[:2] + pace * way)
        if self.returning and np.all(np.abs(pose[:2]) < 0.6 * self.half):
            self.returning = False
        elif not self.returning and np.any((there > self.half) & (there > np.abs(pose[:2]))):
            self.returning, self.home = True, self.half * self.u(-0.3, 0.3, 2)
        if not self.returning:
            return next(self.plan)
        error = self.bearing(self.home)
        return 0.6 * self.speed * max(math.cos(error), 0) ** 2, self.limited(self.gain * error)

    def bearing(self, point: np.ndarray) -> float:
        return math.remainder(math.atan2(*(point - self.pose[:2])[::-1]) - self.pose[2], 2 * math.pi)

    def limited(self, rate: float) -> float:
        return min(max(rate, -0.8 * self.yaw), 0.8 * self.yaw)

    def hold(self, seconds: float, v: float = 0.0, w: float = 0.0, rise: float = 0.0) -> Commands:
        start = self.t
        while self.t < start + seconds:
            part = min((self.t - start) / rise, (start + seconds - self.t) / rise, 1) if rise else 1.0
            yield part * v, part * w

    def turn(self, angle: float) -> Commands:
        goal, late = self.pose[2] + angle, self.t + 3 * abs(angle) / self.yaw + 4
        while abs(error := goal - self.pose[2]) > 0.04 and self.t < late:
            yield 0.0, math.copysign(max(abs(self.limited(self.gain * error)), self.least), error)

    def leg(self, length: float) -> Commands:
        start, heading, begun, rest = self.pose[:2].copy(), self.pose[2], self.t, length
        while rest > 0 and self.t < begun + 3 * length / self.speed + 4:
            rest = length - np.hypot(*(self.pose[:2] - start))
            braking = math.sqrt(2 * self.brake * max(rest, 0)) + 0.05 * self.speed
            v = min(self.speed, braking, self.brake * (self.t - begun + 0.2))
            yield v, self.limited(self.gain * (heading - self.pose[2]))

    def steps(self) -> Commands:
        while True:
            v, w = self.speed * self.u(-0.5, 1), self.yaw * self.u(-1, 1)
            which = self.u()
            yield from self.hold(self.u(2, 8), 0.0 if which < 0.2 else v, 0.0 if which > 0.8 else w)

    def joystick(self) -> Commands:
        stick = np.zeros(2)
        while True:
            forward = self.rng.choice([self.u(0.3, 1), self.u(-0.7, -0.2), 0], p=[0.75, 0.13, 0.12])
            turn, end = self.rng.choice([0, self.u(-1, 1)], p=[0.25, 0.75]), self.t + self.u(0.4, 3.5)
            while self.t < end:
                stick += (np.array([forward, turn]) - stick) * min(self.tick / 0.15, 1)
                v, w = (np.round(127 * stick) / 127).tolist()
                yield self.speed * v, self.yaw * w

    def waypoints(self) -> Commands:
        v = 0.0
        while True:
            n = int(self.rng.integers(4, 8))
            angles = (np.arange(n) + self.u(-0.25, 0.25, n)) * 2 * math.pi / n * self.rng.choice([-1, 1])
            knots = np.column_stack([np.cos(angles), np.sin(angles)]) * self.u(0.35, 0.85, (n, 1)) * self.half
            if n == 4:
                knots = knots[[0, 1, 3, 2]]  # crosses itself like an eight
            spline = CubicSpline(np.arange(n + 1), np.vstack([knots, knots[:1]]), bc_type="periodic")
            grid = np.linspace(0, n, 600, endpoint=False)
            path, (dx, dy), (ddx, ddy) = spline(grid), spline(grid, 1).T, spline(grid, 2).T
            bend = np.abs(dx * ddy - dy * ddx) / np.maximum(np.hypot(dx, dy), 1e-6) ** 3
            profile = np.minimum(self.speed, 0.7 * np.minimum(self.yaw / bend, np.sqrt(self.brake / bend)))
            at, end = int(np.argmin(np.hypot(*(path - self.pose[:2]).T))), self.t + self.u(40, 90)
            while self.t < end:
                window = (at + np.arange(60)) % 600
                at = int(window[np.argmin(np.hypot(*(path[window] - self.pose[:2]).T))])
                reach = 0.06 * self.half.max() + np.hypot(*self.pace) * (self.lag + 0.4)
                far = np.hypot(*(path[(at + np.arange(200)) % 600] - self.pose[:2]).T) > reach
                goal = (at + int(np.argmax(far))) % 600
                error = self.bearing(path[goal])
                ahead = float(profile[(at + np.arange(max((goal - at) % 600, 1))) % 600].min())
                v = min(v + self.brake * self.tick, max(ahead, 0.1 * self.speed) * max(math.cos(error), 0))
                bent = self.limited(2 * v * math.sin(error) / max(reach, 1e-3))
                yield v, bent if abs(error) < 1.2 else self.limited(self.gain * error)

    def spins(self) -> Commands:
        while True:
            spin = self.yaw * self.u(0.25, 1) * self.rng.choice([-1, 1])
            yield from self.hold(self.u(2, 7), 0.0, spin) if self.u() < 0.6 else self.turn(self.u(-3, 3))
            yield from self.hold(self.u(0.2, 1))
            if self.u() < 0.5:
                yield from self.leg(self.half.min() * self.u(0.2, 0.5))

    def square(self) -> Commands:
        side, way = self.half.min() * self.u(0.6, 1.1), self.rng.choice([-1, 1])
        while True:
            for _ in range(4):
                yield from self.leg(side)
                yield from self.hold(self.u(0.1, 0.6))
                yield from self.turn(way * math.pi / 2)
                yield from self.hold(self.u(0.1, 0.6))
            way = self.rng.choice([way, -way])

    def stop_go(self, back: tuple[float, ...] = (1, 1, -0.6, 1), rest: tuple[float, float] = (0.4, 1.6)) -> Commands:
        while True:
            for sign in back:
                v, w = sign * self.speed * self.u(0.3, 1), self.yaw * self.u(-0.8, 0.8) * (self.u() < 0.75)
                yield from self.hold(self.u(2, 5.5), v, w, rise=self.u(0.1, 1))
                yield from self.hold(self.u(*rest))

    def reversing(self) -> Commands:
        return self.stop_go((1, -0.7), (0, 0.5))


def simulate(v: Record, day: Record, r: Record) -> tuple[np.ndarray, np.ndarray]:
    """Drive; return the pose of the middle of the vehicle every millisecond, and rows of time and two commands."""
    rng, p = np.random.default_rng(r.seed), plant(v, day, r)
    driver, tick = Driver(v, r, rng), round(1 / v.command_rate_hz / DT)
    count = int(r.length_s * v.command_rate_hz)
    track, sent, log = np.zeros((count * tick // 5, 3)), np.zeros((count, 2)), np.zeros((count, 3))
    arrivals, s, latest, lost = np.zeros(count), np.zeros(STATES), 0.0, False
    s[[X, Y, YAW]] = *(driver.half * rng.uniform(-0.3, 0.3, 2)), rng.uniform(-3, 3)
    s[SWIVEL : SWIVEL + 4], s[AGE], scale = rng.uniform(-3, 3, 4), 1e9, np.array(v.command_full_scale)
    machine, blur = r.style in ("waypoints", "square"), np.array([*2 * [v.noise_m_rad[0]], v.noise_m_rad[1]])
    delay = round(1000 * (v.localisation_latency_s if machine else 0.2))
    for k in range(count):
        t = k * tick * DT
        seen, before = (track[max(k * tick // 5 - 1 - delay - back, 0)] for back in (0, 100))
        command = driver(t, seen + blur * rng.normal(size=3) * machine, 10 * (seen - before)[:2])
        speed, yaw = command if 1.5 < t < r.length_s - 1.5 else (0.0, 0.0)
        if not v.interface.startswith("body"):
            speed, yaw = speed - v.track_m / 2 * yaw, speed + v.track_m / 2 * yaw
        value = np.round(np.array([speed, yaw]) / scale, 2 if "normalised" in v.interface else 3)
        value = np.clip(value, -1, 1) if "normalised" in v.interface else value
        log[k] = t, *value
        lost = rng.random() < (0.7 if lost else v.commands_lost)
        sent[k] = np.nan if lost else scale * value * (np.abs(value) >= v.command_dead_zone)
        arrivals[k] = latest = max(latest, t + v.command_latency_s + v.latency_jitter_s * rng.exponential())
        advance(s, p, (k * tick, k * tick + tick), arrivals[: k + 1], sent, track)
    return shifted(track, -v.centre_of_mass_m[0], -v.centre_of_mass_m[1]), log


def observe(v: Record, day: Record, track: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return what the localisation delivers: rows of stamp, x, y and heading."""
    rate = v.frame_rate_hz
    times = np.cumsum(np.maximum(rng.normal(1, v.frame_jitter, int(len(track) / 1000 * rate) - 1), 0.1)) / rate
    times = times[times < (len(track) - 1) / 1000]
    poses = np.column_stack([np.interp(times, np.arange(len(track)) / 1000, column) for column in track.T])
    poses, share = shifted(poses, *day.marker_m), v.noise_drift_share
    keep = math.exp(-1 / rate / 5)
    drift = lfilter([math.sqrt(1 - keep**2)], [1, -keep], rng.normal(size=poses.shape), axis=0)
    noise = math.sqrt(1 - share**2) * rng.normal(size=poses.shape) + share * drift
    poses += noise * np.array([v.noise_m_rad[0], v.noise_m_rad[0], v.noise_m_rad[1]]) + [0, 0, day.marker_heading_rad]
    if v.pose_filter == "causal low-pass":
        keep = math.exp(-1 / rate / v.filter_s)
        poses = poses[0] + lfilter([1 - keep], [1, -keep], poses - poses[0], axis=0)
    elif v.pose_filter == "centred mean":
        poses = uniform_filter1d(poses, max(round(v.filter_s * rate), 1), axis=0, mode="nearest")
    repeated = np.flatnonzero(rng.random(len(poses)) < v.frames_repeated)
    poses[repeated] = poses[np.maximum(repeated - 1, 0)]
    seen = rng.random(len(poses)) >= v.frames_lost
    for start in rng.uniform(0, times[-1], rng.poisson(v.gaps_per_minute * times[-1] / 60)):
        seen &= (times < start) | (times > start + rng.uniform(0.1, 0.8))
    stamps = times + v.localisation_latency_s + day.clock_offset_s
    return np.column_stack([stamps, poses])[seen]


def table(v: Record, r: Record, poses: np.ndarray, log: np.ndarray) -> pd.DataFrame:
    """Return the file as the lab's logger wrote it."""
    log = log[:: round(v.command_rate_hz / v.logger_rate_hz)]
    names = ["left", "right"] if v.interface.startswith("wheels") else ["cmd_speed", "cmd_yaw_rate"]
    seen = pd.DataFrame(poses, columns=["t", "x", "y", "yaw"])
    seen["yaw"] = np.arctan2(np.sin(seen["yaw"]), np.cos(seen["yaw"]))
    commands = pd.DataFrame(log, columns=["t", *names])
    if v.file == "merged":
        rows = pd.concat([seen, commands]).sort_values("t", kind="stable")
    else:
        rows = pd.merge_asof(seen, commands, on="t") if v.file == "joined" else pd.merge_asof(commands, seen, on="t")
    if v.millimetres_and_degrees:
        rows[["x", "y"]], rows["yaw"] = 1000 * rows[["x", "y"]], np.degrees(rows["yaw"])
    rows = rows.round({"x": 5, "y": 5, "yaw": 5, **dict.fromkeys(names, 4)})
    absolute = rows.pop("t") + (0 if v.time_unit == "ms" else r.start_unix_s)
    clock = absolute.round(5) if v.time_unit == "s" else (1e6 * absolute).round().astype("int64")
    rows.insert(0, "time", clock if v.time_unit == "s" else clock * 1000 if v.time_unit == "ns" else clock / 1000)
    return rows


def mapping(v: Record, days: list[Record]) -> str:
    """Return the mapping for agvbench, with what the lab knows: nominal sizes and units."""
    wheels, rate = v.interface.startswith("wheels"), v.logger_rate_hz if v.file == "table" else v.frame_rate_hz
    unit = v.interface.split()[1]
    sizes = "" if wheels else f'command_unit = "{unit}"\nneutral = 0.0'
    if wheels:
        high = 1.0 if unit == "normalised" else round(1.5 * v.wheel_speed_limit_m_per_s / v.command_full_scale[0], 1)
        sizes += "" if unit == "normalised" else f"[channels]\ntrack_m = {v.track_m:.3f}\n"
        sizes += f"wheel_radius_m = {v.wheel_radius_m:.4f}\n" if unit == "rad/s" else ""
        for side in ("left", "right"):
            sizes += f'[channels.{side}]\nunit = "{unit}"\nneutral = 0.0\nlow = {-high}\nhigh = {high}\n'
    metre, radian = ("mm", "deg") if v.millimetres_and_degrees else ("m", "rad")
    clock = "file" if v.time_unit == "ms" else "absolute"
    names = ("left", "right") if wheels else ("cmd_speed", "cmd_yaw_rate")
    text = f"""schema = 1
name = "foreign-{v.seed}"

[vehicle]
name = "{v.kind}"
kinematics = "differential"
rear_axle_m = {days[0].marker_m[0]:.3f}
{sizes}
[mocap]
rate_hz = {rate}

[prediction]
horizon_s = 2.0
stride_s = 1.0

[columns]
time = {{ column = "time", unit = "{v.time_unit}", clock = "{clock}" }}
x = {{ column = "x", unit = "{metre}" }}
y = {{ column = "y", unit = "{metre}" }}
heading = {{ column = "yaw", unit = "{radian}" }}
{"left" if wheels else "drive"} = {{ column = "{names[0]}" }}
{"right" if wheels else "front"} = {{ column = "{names[1]}" }}

[gate]
max_speed_m_per_s = {2 * v.largest_speed_m_per_s:.2f}
max_yaw_rate_rad_per_s = {2 * v.largest_yaw_rate_rad_per_s:.2f}
slack_m = {max(0.02, 8 * v.noise_m_rad[0]):.3f}
slack_rad = {max(0.1, 8 * v.noise_m_rad[1]):.3f}

[runs]
experiment = "free"
gap_s = {max(0.5, 3 / rate):.2f}
shortest_s = 4.0
command_hold_s = {1 / v.logger_rate_hz}
"""
    return text + "".join(f'\n[[files]]\nmatch = "{d.date}_*"\nsession = "{d.date}"\n' for d in days)


def write(folder: Path, seed: int) -> None:
    """Write the recordings, the mapping and the truth of a vehicle."""
    v, days, recordings = draw(seed)
    folder.mkdir(parents=True, exist_ok=True)
    for r in recordings:
        track, log = simulate(v, days[r.day], r)
        poses = observe(v, days[r.day], track, np.random.default_rng(r.seed + 50))
        table(v, r, poses, log).to_csv(folder / f"{r.name}.csv", index=False)
    truth = {"vehicle": vars(v), "days": [*map(vars, days)], "recordings": [*map(vars, recordings)], "notes": NOTES}
    (folder / "truth.json").write_text(json.dumps(truth, indent=1))
    (folder / "mapping.toml").write_text(mapping(v, days))


def line(seed: int) -> str:
    """Describe a vehicle in a line."""
    v, days, recordings = draw(seed)
    grounds, styles = ",".join({d.surface: 0 for d in days}), ",".join({r.style: 0 for r in recordings})
    speed, yaw = v.largest_speed_m_per_s, v.largest_yaw_rate_rad_per_s
    size = f"{v.mass_kg:.1f} kg, {v.track_m:.2f} m, {speed:.2f} m/s {yaw:.1f} rad/s"
    eyes = f"{v.tracker} {v.frame_rate_hz:.0f} Hz {1000 * v.noise_m_rad[0]:.1f} mm {1000 * v.noise_m_rad[1]:.1f} mrad"
    drive, minutes = f"{v.drive}, {v.interface}, {v.command_latency_s:.2f} s", sum(r.length_s for r in recordings) / 60
    return f"{seed} | {v.kind} | {size} | {drive} | {grounds} | {eyes} | {len(recordings)}: {minutes:.0f} min, {styles}"


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    writing, listing = commands.add_parser("write"), commands.add_parser("list")
    writing.add_argument("folder", type=Path)
    writing.add_argument("--vehicle", type=int, required=True)
    listing.add_argument("--vehicles", type=int, default=12)
    options = parser.parse_args()
    if options.command == "write":
        write(options.folder, options.vehicle)
    else:
        print("\n".join(line(seed) for seed in range(1, options.vehicles + 1)))


if __name__ == "__main__":
    from driven_robots import main as run  # numba keeps compiled functions for a module, not for __main__

    run()
