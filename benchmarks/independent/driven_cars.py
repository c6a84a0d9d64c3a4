"""Recordings of hand-driven model cars of other laboratories, simulated.

Each vehicle is drawn from its number. Its motion is a planar dynamic model with four tyres, a drive line with stiction,
a motor behind an ESC (or an onboard speed controller) on a sagging battery, and a servo with rate, lag and play. A
person or a path follower drives it by delayed feedback; a tracker and a logger with their own clocks record it.

    python driven_cars.py write DIR --vehicle N
    python driven_cars.py list [--first 1] [--last 12]
"""

import argparse
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numba import njit

TICK = 0.01  # s: commands are sent on this grid; the driver moves the sticks every other tick
STEPS = 30  # integration steps per tick: 0.33 ms each
DT = TICK / STEPS
TRACE_EVERY = 3  # the trace holds every millisecond
G = 9.81
SLIP_SPEED = 0.08  # m/s: below it, slips are regularised, and tyres act as stiff viscous dampers (kinematic motion)

DRIVES = ["voltage to the motor", "torque by the throttle, falling with speed", "onboard PI speed controller"]
NEGATIVE = ["reverses at once", "brakes while rolling, then reverses", "brakes; reverses after a return to neutral"]
TYRES = ["Pacejka", "Fiala"]
CONTROL = ("servo", "linkage", "set", "measured", "integral", "charge", "sag", "esc")
STATE = ("x", "y", "yaw", "vx", "vy", "yaw_rate", "front", "rear", "ax", "ay", *CONTROL)
TRACE = ("x", "y", "yaw", "vx", "vy", "yaw_rate", "ax", "ay", "rim", "wheel_angle", "battery", "slip_angle")
STYLES = ["joystick", "laps", "steering sweeps", "skid pad", "slalom", "stop and go"]


@njit(cache=True)
def tyre(p: Any, slip: float) -> float:
    """Give the share of the available friction that a combined slip uses."""
    if p.tyre_model == 0.0:
        b = p.cornering_stiffness_per_load_per_rad / (p.friction_coefficient * p.pacejka_shape_c)
        z = b * slip
        return math.sin(p.pacejka_shape_c * math.atan(z - p.pacejka_curvature_e * (z - math.atan(z))))
    z = p.cornering_stiffness_per_load_per_rad * slip / (3.0 * p.friction_coefficient)
    return 1.0 if z >= 1.0 else 3.0 * z - 3.0 * z * z + z**3


@njit(cache=True)
def stick_curve(p: Any, u: float) -> float:
    """Give the duty that the ESC makes of a throttle: dead band, expo, and a weaker reverse."""
    band = p.dead_band_forward if u > 0.0 else p.dead_band_reverse
    if abs(u) <= band:
        return 0.0
    z = (min(abs(u), 1.0) - band) / (1.0 - band)
    z = (1.0 - p.throttle_expo) * z + p.throttle_expo * z**3
    return z if u > 0.0 else -z * p.reverse_share


@njit(cache=True)
def motor(p: Any, s: Any, throttle: float, rim: float, battery: float) -> tuple[float, float]:
    """Give the motor's force at the rims, and the share of the stall current that it draws."""
    duty = stick_curve(p, throttle)
    turning = rim / p.no_load_speed_m_per_s
    if p.drive_kind == 2.0:
        step = p.speed_controller_acceleration_limit_m_per_s2 * DT
        s.set += min(max(duty * p.speed_controller_full_scale_m_per_s - s.set, -step), step)
        s.measured += DT / p.speed_controller_filter_s * (rim - s.measured)
        error = s.set - s.measured
        raw = s.set / p.no_load_speed_m_per_s + p.speed_controller_gain_s_per_m * error + s.integral
        if abs(s.set) < 0.01 and abs(s.measured) < 0.05:
            s.integral = 0.0
            raw = 0.0
        elif abs(raw) < 1.0 or raw * error < 0.0:
            s.integral += p.speed_controller_integral_gain_per_m * error * DT
        duty = min(max(raw, -1.0), 1.0)
        force = min(max(duty * battery - turning, -0.8), 0.8)
        return p.stall_force_n * force, abs(force * duty)
    if duty == 0.0:
        if s.esc == 1.0 and p.negative_throttle == 2.0:
            s.esc = 2.0  # neutral after braking: the ESC may reverse now
        return -p.drag_brake_force_n * math.tanh(rim / p.brake_fade_speed_m_per_s), 0.0
    if duty > 0.0:
        s.esc = 0.0
    elif p.negative_throttle > 0.0 and s.esc != 2.0:
        if p.negative_throttle == 1.0 and rim < 0.03:
            s.esc = 2.0
        else:
            s.esc = 1.0
    if duty < 0.0 and p.negative_throttle > 0.0 and (s.esc == 1.0 or rim > 0.05):
        return p.brake_force_n * duty * math.tanh(rim / p.brake_fade_speed_m_per_s), 0.0
    if p.drive_kind == 1.0:
        force = duty * min(max(battery - turning * (1.0 if duty > 0.0 else -1.0), 0.0), 1.2)
    else:
        force = duty * battery - turning
        if p.motor_brakes_at_part_throttle == 0.0 and force * duty < 0.0:
            force = 0.0
    return p.stall_force_n * force, abs(force * duty)


@njit(cache=True)
def turn_wheel(m: float, rim: float, force: float, pull: float, grip: float, friction: float) -> float:
    """Advance a rim's speed implicitly in the tyre force (pull − grip·rim), then let dry friction stop it."""
    slack = 1.0 + DT * grip / m
    rim = (rim + DT * (force + pull) / m) / slack
    stop = DT * friction / (m * slack)
    return 0.0 if abs(rim) <= stop else rim - math.copysign(stop, rim)


@njit(cache=True)
def advance(state: Any, plant: Any, sent: np.ndarray, first: int, ticks: int, trace: np.ndarray) -> None:
    """Integrate some ticks; the sticks of tick k, sent[k], arrive after the latencies."""
    s, p = state[0], plant[0]
    a, b, half, base = p.cg_to_front_axle_m, p.cg_to_rear_axle_m, p.track_m / 2.0, p.wheelbase_m
    load, offset, speed, axis = np.zeros(4), np.zeros(4), np.zeros(4), np.zeros((4, 2))
    grip, side, turned = np.zeros(4), np.zeros(4), np.zeros(4)
    for n in range(ticks * STEPS):
        now = first * TICK + n * DT
        throttle = sent[max(int((now - p.throttle_latency_s) / TICK + 1e-9), 0), 0]
        stick = sent[max(int((now - p.steering_latency_s) / TICK + 1e-9), 0), 1]

        rate = (min(max(stick, -1.0), 1.0) - s.servo) / p.servo_lag_s
        s.servo += DT * min(max(rate, -p.servo_rate_per_s), p.servo_rate_per_s)
        play = p.steering_backlash_of_half_travel / 2.0
        s.linkage = min(max(s.linkage, s.servo - play), s.servo + play)
        z = s.linkage
        angle = p.steering_gain_rad * (z + p.linkage_quadratic * z * z + p.linkage_cubic * z**3) + p.steering_trim_rad
        angle = min(max(angle, -p.steering_stop_right_rad), p.steering_stop_left_rad)

        rise = p.cg_height_m * p.mass_kg
        for i in range(4):
            front, left = i < 2, i % 2 == 0
            share = p.roll_stiffness_share_front if front else 1.0 - p.roll_stiffness_share_front
            rest = p.mass_kg * G * (b if front else a) / base / 2.0
            moved = rise * s.ax / base / 2.0 * (-1.0 if front else 1.0)
            moved += rise * s.ay / p.track_m * share * (-1.0 if left else 1.0)
            load[i] = max(rest + moved, 0.02 * rest)
            y, x = half if left else -half, a if front else -b
            tan = math.tan(angle)
            turned[i] = math.atan(tan / (1.0 - p.ackermann_share * y / base * tan)) if front else 0.0
            axis[i, 0], axis[i, 1] = math.cos(turned[i]), math.sin(turned[i])
            u, v = s.vx - s.yaw_rate * y, s.vy + s.yaw_rate * x
            speed[i] = axis[i, 0] * u + axis[i, 1] * v
            side[i] = axis[i, 0] * v - axis[i, 1] * u
        slip_angle = math.atan2(abs(s.vy - b * s.yaw_rate), max(abs(s.vx), SLIP_SPEED))
        for i in range(4):
            front = i < 2
            mean = (speed[0] + speed[1]) / 2.0 if front else (speed[2] + speed[3]) / 2.0
            locked = p.differential_lock if (not front or p.all_wheel_drive == 1.0) else 0.0
            offset[i] = mean + locked * (speed[i] - mean)
            rim = s.front if front else s.rear
            fast = max(abs(speed[i]), abs(rim + speed[i] - offset[i]))
            unit = math.sqrt(fast * fast + SLIP_SPEED**2)
            along = p.longitudinal_stiffness_ratio * (rim - offset[i]) / unit
            slip = math.sqrt(along**2 + (side[i] / unit) ** 2 + 1e-12)
            mu = p.friction_coefficient * (p.front_grip_factor if front else 1.0)
            rest = p.mass_kg * G * (b if front else a) / base / 2.0
            mu *= max(1.0 - p.load_sensitivity * (load[i] / rest - 1.0), 0.3)
            secant = mu * load[i] * tyre(p, slip) / (slip * unit)
            grip[i] = secant * p.longitudinal_stiffness_ratio
            side[i] = -secant * side[i]

        battery = p.battery_full_voltage_ratio - p.battery_fade_per_charge * (1.0 - s.charge)
        battery -= 0.1 * math.exp(-s.charge / 0.05) + s.sag
        driven = (s.front + s.rear) / 2.0 if p.all_wheel_drive == 1.0 else s.rear
        force, current = motor(p, s, throttle, driven, battery)
        s.sag += DT / 0.05 * (p.battery_sag_at_stall * current - s.sag)
        s.charge = max(s.charge - DT * current / p.battery_capacity_s_at_stall, 0.0)
        stribeck = math.exp(-((driven / p.stribeck_speed_m_per_s) ** 2))
        dry = p.drive_kinetic_friction_n + (p.drive_static_friction_n - p.drive_kinetic_friction_n) * stribeck
        dry += p.rolling_resistance * (load[2] + load[3])
        force -= p.drive_viscous_drag_n_s_per_m * driven
        pulls_f = grip[0] * offset[0] + grip[1] * offset[1]
        pulls_r = grip[2] * offset[2] + grip[3] * offset[3]
        axle, rotor, roll_f = p.axle_inertia_as_mass_kg, p.motor_inertia_as_mass_kg, load[0] + load[1]
        roll_f *= p.rolling_resistance
        if p.all_wheel_drive == 1.0:
            m, stiff = 2.0 * axle + rotor, grip[0] + grip[1] + grip[2] + grip[3]
            s.rear = turn_wheel(m, driven, force, pulls_f + pulls_r, stiff, dry + roll_f)
            s.front = s.rear
        else:
            s.rear = turn_wheel(axle + rotor, s.rear, force, pulls_r, grip[2] + grip[3], dry)
            s.front = turn_wheel(axle, s.front, 0.0, pulls_f, grip[0] + grip[1], roll_f)

        fx, fy, moment = -p.air_drag_n_s2_per_m2 * s.vx * abs(s.vx), 0.0, 0.0
        for i in range(4):
            front = i < 2
            push = grip[i] * ((s.front if front else s.rear) - offset[i])
            gx, gy = axis[i, 0] * push - axis[i, 1] * side[i], axis[i, 1] * push + axis[i, 0] * side[i]
            fx, fy = fx + gx, fy + gy
            moment += (a if front else -b) * gy - (half if i % 2 == 0 else -half) * gx
        ax, ay = fx / p.mass_kg, fy / p.mass_kg
        s.ax += DT / p.load_transfer_lag_s * (ax - s.ax)
        s.ay += DT / p.load_transfer_lag_s * (ay - s.ay)
        u = s.vx
        s.vx += DT * (ax + s.yaw_rate * s.vy)
        s.vy += DT * (ay - s.yaw_rate * u)
        s.yaw_rate += DT * moment / p.yaw_inertia_kg_m2
        s.yaw += DT * s.yaw_rate
        s.x += DT * (s.vx * math.cos(s.yaw) - s.vy * math.sin(s.yaw))
        s.y += DT * (s.vx * math.sin(s.yaw) + s.vy * math.cos(s.yaw))
        if (n + 1) % TRACE_EVERY == 0:
            row = trace[(first * STEPS + n + 1) // TRACE_EVERY]
            row[0], row[1], row[2], row[3], row[4], row[5] = s.x, s.y, s.yaw, s.vx, s.vy, s.yaw_rate
            row[6], row[7], row[8], row[9], row[10], row[11] = s.ax, s.ay, driven, angle, battery, slip_angle


def as_record(values: dict[str, float]) -> np.ndarray:
    """Give numba a structure of these numbers."""
    return np.array([tuple(values.values())], dtype=[(key, "f8") for key in values])


def at_rest(charge: float, yaw: float = 0.0) -> np.ndarray:
    """Give the state of a vehicle that stands at the origin."""
    return as_record({**dict.fromkeys(STATE, 0.0), "charge": charge, "yaw": yaw})


@dataclass
class Vehicle:
    """A vehicle, its laboratory and its days, as drawn from its number."""

    number: int
    scale: int
    plant: dict[str, float]
    lab: dict[str, Any]
    days: list[dict[str, Any]]
    recordings: list[dict[str, Any]]
    driver: dict[str, Any]


def draw_plant(rng: np.random.Generator, scale: int, size: float, use: float) -> dict[str, float]:
    """Draw the physics of a vehicle; size is 0 for 1:24 and 1 for 1:5, use is the share of grip used."""
    u = rng.uniform
    base = 2.6 / scale * u(0.9, 1.1)
    mass = 1.8 * (10 / scale) ** 3 * u(0.9, 1.8)
    a = base * u(0.44, 0.58)
    low, high = [(0.8, 1.1), (0.5, 0.85), (0.25, 0.45), (0.6, 0.9)][rng.integers(4)]
    mu, track, lock = u(low, high), base * u(0.55, 0.75), u(0.3, 0.52)
    top = float(np.exp(u(np.log(0.5 + 1.3 * size), np.log(2 + 4 * size))))
    if use > 0.9:  # fast enough to slide
        top = max(top, min(1.3 * math.sqrt(use * mu * G * base / math.tan(lock)), 2 + 4 * size))
    kind = int(rng.choice(3, p=[0.45, 0.27, 0.28]))
    free = top * (u(1.1, 1.8) if kind != 1 else u(1.3, 2.5))
    stall = mass * max(u(2.0, 6.0), 1.3 * top)
    friction = min(mass * u(0.12, 0.45), 0.12 * stall)
    latency = float(np.exp(u(np.log(0.01), np.log(0.25))))
    stops = rng.permutation([u(0.95, 1.05), u(0.82, 1.05)]) * lock
    bandwidth = u(4, 14)
    # fmt: off
    return {
        "wheelbase_m": base, "cg_to_front_axle_m": a, "cg_to_rear_axle_m": base - a, "track_m": track,
        "cg_height_m": track * u(0.15, 0.3), "mass_kg": mass,
        "yaw_inertia_kg_m2": mass * a * (base - a) * u(0.85, 1.3), "roll_stiffness_share_front": u(0.4, 0.62),
        "load_transfer_lag_s": u(0.015, 0.05), "tyre_model": float(rng.integers(2)), "friction_coefficient": mu,
        "cornering_stiffness_per_load_per_rad": max(u(6, 16), 6 * mu), "pacejka_shape_c": u(1.25, 1.65),
        "pacejka_curvature_e": u(-0.5, 0.6), "longitudinal_stiffness_ratio": u(0.9, 1.3),
        "front_grip_factor": u(0.88, 1.0), "load_sensitivity": u(0.0, 0.15),
        "all_wheel_drive": float(rng.random() < 0.5),
        "differential_lock": float(rng.choice([0.0, 0.3, 1.0], p=[0.6, 0.2, 0.2])),
        "axle_inertia_as_mass_kg": mass * u(0.02, 0.05), "motor_inertia_as_mass_kg": mass * u(0.04, 0.3),
        "drive_kind": float(kind), "stall_force_n": stall, "no_load_speed_m_per_s": free,
        "motor_brakes_at_part_throttle": float(rng.random() < 0.5),
        "dead_band_forward": u(0.0, 0.02) if kind == 2 else u(0.01, 0.12),
        "dead_band_reverse": u(0.0, 0.02) if kind == 2 else u(0.01, 0.15),
        "throttle_expo": 0.0 if kind == 2 or rng.random() < 0.4 else u(0.1, 0.6),
        "reverse_share": 1.0 if kind == 2 else u(0.4, 1.0),
        "drag_brake_force_n": 0.0 if rng.random() < 0.5 else mass * u(0.4, 2.5), "brake_force_n": mass * u(2.0, 7.0),
        "brake_fade_speed_m_per_s": u(0.15, 0.5), "negative_throttle": float(rng.choice(3, p=[0.25, 0.4, 0.35])),
        "drive_kinetic_friction_n": friction, "drive_static_friction_n": friction * u(1.1, 1.8),
        "stribeck_speed_m_per_s": u(0.03, 0.12), "rolling_resistance": u(0.008, 0.025),
        "drive_viscous_drag_n_s_per_m": mass * (u(0.3, 0.9) if kind == 1 else u(0.03, 0.3)),
        "air_drag_n_s2_per_m2": 0.5 * 1.2 * 0.6 * 0.6 * track**2,
        "speed_controller_full_scale_m_per_s": top * u(1.0, 1.2),
        "speed_controller_acceleration_limit_m_per_s2": u(0.8, 4.0),
        "speed_controller_gain_s_per_m": bandwidth * mass / stall,
        "speed_controller_integral_gain_per_m": bandwidth * mass / stall * u(0.5, 4.0),
        "speed_controller_filter_s": u(0.01, 0.04), "battery_full_voltage_ratio": 1.04,
        "battery_fade_per_charge": u(0.08, 0.18), "battery_sag_at_stall": u(0.02, 0.2),
        "battery_capacity_s_at_stall": u(250, 1200), "steering_gain_rad": lock, "steering_stop_left_rad": stops[0],
        "steering_stop_right_rad": stops[1], "steering_trim_rad": rng.normal(0, 0.012),
        "linkage_quadratic": u(-0.08, 0.08), "linkage_cubic": u(-0.2, 0.12), "ackermann_share": u(0.0, 1.1),
        "servo_rate_per_s": u(3.5, 14), "servo_lag_s": u(0.01, 0.06),
        "steering_backlash_of_half_travel": 0.0 if rng.random() < 0.5 else u(0.02, 0.16),
        "throttle_latency_s": latency,
        "steering_latency_s": latency if rng.random() < 0.6 else max(latency * u(0.6, 1.2), 0.01),
    }
    # fmt: on


def draw_lab(rng: np.random.Generator, scale: int, plant: dict[str, float]) -> dict[str, Any]:
    """Draw the tracker, the logger and the lab's habits."""
    u = rng.uniform
    tracker = str(rng.choice(["motion capture", "camera", "lidar"], p=[0.45, 0.35, 0.2]))
    if tracker == "lidar" and scale > 12:
        tracker = "camera"
    fps, mm, mrad, late = {
        "motion capture": (rng.choice([50, 100, 100, 120, 200]), u(0.1, 0.6), u(0.5, 2.5), u(0.002, 0.015)),
        "camera": (rng.choice([15, 20, 25, 30, 50, 60]), u(1, 5), u(2, 8), u(0.02, 0.08)),
        "lidar": (rng.choice([10, 20, 25, 40]), u(4, 10), u(4, 10), u(0.03, 0.12)),
    }[tracker]
    base = plant["wheelbase_m"]
    si = plant["drive_kind"] == 2 and rng.random() < 0.7
    # fmt: off
    return {
        "tracker": tracker, "frame_rate_hz": float(fps), "position_noise_mm": mm, "heading_noise_mrad": mrad,
        "position_distortion_mm": mm * u(0, 2), "frame_jitter_share": u(0, 0.08),
        "dropped_share": u(0, 0.03) if rng.random() < 0.7 else 0.0,
        "repeated_share": u(0.005, 0.05) if rng.random() < 0.3 else 0.0,
        "gaps_per_minute": u(0.3, 3) if rng.random() < 0.6 else 0.0,
        "lost_poses": str(rng.choice(["no row", "empty cells", "stale pose with valid = 0"])),
        "camera_latency_s": late, "camera_clock_offset_varies": bool(rng.random() < 0.3),
        "rows": "at the logger's ticks, with the last pose" if rng.random() < 0.2 else "at the camera's frames",
        "logger_rate_hz": float(rng.choice([10, 20, 25, 30, 50, 50, 100])),
        "command_period_s": TICK * int(rng.choice([1, 2, 2, 4, 5, 10])),
        "command_unit": "si" if si else str(rng.choice(["normalised", "us"], p=[0.65, 0.35])),
        "throttle_us": [1500.0, float(rng.choice([400, 500]))],
        "steering_us": [float(rng.choice([1500, 1500, 1520])), float(rng.choice([-1, 1])) * 400.0],
        "steering_positive_left": bool(rng.random() < 0.75), "stick_steps": int(rng.choice([127, 500])),
        "length_unit": str(rng.choice(["m", "m", "mm"])), "angle_unit": str(rng.choice(["rad", "rad", "deg"])),
        "time_unit": str(rng.choice(["s", "s", "ms", "us"])), "wheelbase_stated_m": base * (1 + u(-0.03, 0.03)),
        "marker_ahead_of_mid_wheelbase_m": base * u(-0.5, 0.5), "marker_left_of_centre_line_m": base * u(-0.08, 0.08),
        "marker_yaw_offset_rad": rng.normal(0, 0.02),
    }
    # fmt: on


def draw_vehicle(number: int) -> Vehicle:
    """Draw everything that does not depend on the driving."""
    rng = np.random.default_rng([20_26, number])
    u = rng.uniform
    scale = int(rng.choice([24, 18, 16, 14, 12, 10, 10, 8, 8, 6, 5]))
    size = (1 / scale - 1 / 24) / (1 / 5 - 1 / 24)
    use = [u(0.2, 0.5), u(0.6, 0.9), u(0.95, 1.35)][rng.integers(3)]
    plant = draw_plant(rng, scale, size, use)
    lab = draw_lab(rng, scale, plant)
    lateral = use * plant["friction_coefficient"] * G
    tight = plant["wheelbase_m"] / math.tan(0.9 * plant["steering_gain_rad"])
    cap = min(u(0.55, 0.9) * plant["no_load_speed_m_per_s"], math.sqrt(0.6 * min(lateral, 8.0) * (1 + 6 * size)), 6.0)
    cap = max(cap, 0.5)
    reach = max(1.3 * tight, cap**2 / (0.6 * lateral)) + 0.9 * cap * (0.4 + plant["steering_latency_s"])
    field = max(1.7 * reach, 7 * plant["wheelbase_m"]) * u(1.0, 1.5)
    # fmt: off
    driver = {
        "share_of_grip_used": use, "lateral_acceleration_limit_m_per_s2": lateral, "top_speed_m_per_s": cap,
        "tightest_radius_m": tight, "field_half_sizes_m": [field, field * u(0.7, 1.0)], "reaction_s": u(0.12, 0.28),
        "brakes_with_negative_throttle": bool(rng.random() < 0.6),
    }
    # fmt: on
    first = date(2023, 1, 9) + timedelta(days=int(rng.integers(700)))
    days: list[dict[str, Any]] = []
    trims = 0.015 if rng.random() < 0.4 else 0.0
    for _ in range(int(rng.integers(2, 4))):
        offset = u(-0.15, 0.15) if lab["camera_clock_offset_varies"] and rng.random() < 0.6 else 0.0
        one: dict[str, Any] = {"day": first.strftime("%Y%m%d"), "friction_factor": u(0.92, 1.08)}
        one |= {"drive_friction_factor": u(0.85, 1.2), "battery_charge_at_first_recording": u(0.5, 1.0)}
        one |= {"steering_trim_change_rad": rng.normal(0, trims), "camera_clock_ahead_of_command_clock_s": offset}
        days.append(one)
        first += timedelta(days=int(rng.integers(1, 9)))
    pool = rng.choice(STYLES, size=int(rng.integers(1, 5)), replace=False, p=[0.3, 0.25, 0.1, 0.1, 0.1, 0.15])
    recordings: list[dict[str, Any]] = []
    for k in range(max(int(rng.integers(3, 6)), len(days))):
        day = min(k, len(days) - 1) if k < len(days) else int(rng.integers(len(days)))
        seconds = float(np.exp(u(np.log(65), np.log(300))))
        recordings.append({"day": day, "seconds": seconds, "style": str(pool[k % len(pool)]), "seed": k})
    recordings.sort(key=lambda r: r["day"])
    for k, one in enumerate(recordings):
        letter = "abcdefgh"[sum(r["day"] == one["day"] for r in recordings[:k])]
        one["name"] = f"{days[one['day']]['day']}_{letter}"
    return Vehicle(number, scale, plant, lab, days, recordings, driver)


@dataclass
class Segment:
    """What a person intends for some seconds: a speed ramp (nan: hands off), and a steady or waving steering."""

    seconds: float
    speed: float
    speed_end: float
    steer: float
    slew: float = 3.0
    amplitude: float = 0.0
    frequency: float = 0.0


def intentions(style: str, rng: np.random.Generator, car: Vehicle) -> Iterator[Segment]:
    """Give one intention after the other, for a style without a track."""
    u, top, lock = rng.uniform, car.driver["top_speed_m_per_s"], car.plant["steering_gain_rad"]
    speed, steer = 0.5 * top, 0.0
    while True:
        slew = 8.0 if rng.random() < 0.3 else u(0.8, 4.0)
        if style == "joystick":
            seconds, what = 0.3 + rng.exponential(1.0), rng.random()
            choices = [0.0, u(-lock, lock), -steer, rng.choice([-1.2, 1.2]) * lock]
            steer = rng.choice(choices, p=[0.25, 0.5, 0.13, 0.12])
            if rng.random() < 0.35:
                speed = u(0.25, 1.0) * top
            if what < 0.06:
                yield Segment(seconds, math.nan, math.nan, steer, slew)
            elif what < 0.09:
                yield Segment(u(0.8, 2.5), 0.0, 0.0, steer, slew)
            elif what < 0.12:
                yield Segment(u(2, 4), -0.3 * top, -0.3 * top, steer, slew)
            else:
                yield Segment(seconds, speed, speed, steer, slew)
        elif style == "stop and go":
            speed = u(0.35, 1.0) * top
            yield Segment(u(2, 6), speed, speed, u(-0.8, 0.8) * lock, slew)
            what = rng.random()
            if what < 0.5:
                yield Segment(u(0.6, 2.2), 0.0, 0.0, u(-0.5, 0.5) * lock, slew)
            elif what < 0.8:
                yield Segment(u(0.5, 1.5), math.nan, math.nan, 0.0, slew)
            else:
                yield Segment(u(2, 4), -0.3 * top, -0.3 * top, u(-0.8, 0.8) * lock, slew)
        elif style == "skid pad":
            side = rng.choice([-1, 1]) * u(0.35, 1.0) * lock
            yield Segment(u(12, 25), 0.3 * top, top, side, u(0.5, 3.0))
            yield Segment(u(1, 3), 0.5 * top, 0.5 * top, 0.0, slew)
        elif style == "slalom":
            speed = u(0.4, 1.0) * top
            beat = min(speed / (u(8, 16) * car.plant["wheelbase_m"]), 1.4)
            yield Segment(u(6, 14), speed, speed, 0.0, 12.0, u(0.35, 1.0) * lock, beat)
        else:
            speed = u(0.3, 0.9) * top
            yield Segment(u(20, 40), speed, speed, 0.0, 12.0, u(0.5, 1.1) * lock, u(0.04, 0.25))


def draw_track(rng: np.random.Generator, car: Vehicle) -> np.ndarray:
    """Draw a closed track: x, y, the speed, and the mean distance, for each of its points."""
    d = car.driver
    phi = np.linspace(0, 2 * np.pi, 1200, endpoint=False) * rng.choice([-1, 1])
    waves, phase, bend = rng.uniform(0.05, 0.3, 4) / np.array([1, 1, 2, 3]), rng.uniform(0, 6.3, 4), 1.0
    while True:
        r = 1 + bend * sum(w * np.cos((k + 2) * phi + q) for k, (w, q) in enumerate(zip(waves, phase, strict=True)))
        xy = np.stack([r * np.cos(phi), r * np.sin(phi)])
        xy *= (0.75 * np.array(d["field_half_sizes_m"]) / np.abs(xy).max(axis=1))[:, None]
        step = np.roll(xy, -1, axis=1) - np.roll(xy, 1, axis=1)
        heading = np.unwrap(np.arctan2(step[1], step[0]))
        length = np.hypot(*step) / 2
        turn = np.diff(heading, append=heading[0] + 2 * np.pi * np.sign(phi[1])) / length
        if bend < 0.05 or np.abs(turn).max() < 0.75 / d["tightest_radius_m"]:
            break
        bend *= 0.8
    limit = d["lateral_acceleration_limit_m_per_s2"]
    speed = np.minimum(np.sqrt(limit / np.maximum(np.abs(turn), 1e-6)), d["top_speed_m_per_s"] * rng.uniform(0.6, 1.0))
    for k in range(2 * len(speed) - 1, -1, -1):  # brake in time
        i, j = k % len(speed), (k + 1) % len(speed)
        speed[i] = min(speed[i], math.sqrt(speed[j] ** 2 + 2 * min(0.4 * limit, 1.2) * length[i]))
    return np.stack([*xy, speed, np.full_like(speed, length.mean())])


def wrap(angle: float) -> float:
    """Bring an angle into −π…π."""
    return math.remainder(angle, 2 * math.pi)


class Driver:
    """A person (or a path follower) who sees the vehicle late and moves two sticks."""

    def __init__(self, car: Vehicle, style: str, rng: np.random.Generator, table: np.ndarray) -> None:
        self.car, self.rng, self.table, self.style = car, rng, table, style
        d, p = car.driver, car.plant
        self.top = min(d["top_speed_m_per_s"], 0.95 * table[1, -1])
        self.dares, self.care, self.lock = d["lateral_acceleration_limit_m_per_s2"], 1.0, p["steering_gain_rad"]
        self.base, self.field = p["wheelbase_m"], d["field_half_sizes_m"]
        self.lead = 0.8 * (d["reaction_s"] + p["steering_latency_s"])
        delay = d["reaction_s"] + p["throttle_latency_s"] + 0.05
        feedback = 1.0 if style == "laps" else rng.choice([0.0, 0.5, 1.0])  # 0: the stick is set by experience
        self.gain = feedback * min(0.6 / self.top, 0.3 / (delay * p["stall_force_n"] / p["mass_kg"]))
        self.track = draw_track(rng, car) if style == "laps" else np.zeros((4, 0))
        self.plan = intentions(style, rng, car)
        self.segment, self.began = Segment(rng.uniform(0.5, 1.5), 0.0, 0.0, 0.0), 0.0
        self.returning, self.turn, self.stopped, self.extra, self.tremor = False, 1.0, 0.0, 0.0, 0.0
        self.sticks = [0.0, 0.0]
        self.shake = rng.uniform(0.0, 0.03)

    @property
    def limit(self) -> float:
        """Give the lateral acceleration that the driver dares now."""
        return self.dares * self.care

    def lock_at(self, speed: float) -> float:
        """Give the steering angle that the driver dares at a speed."""
        return min(1.1 * self.lock, math.atan(self.base * self.limit / max(speed * speed, 1e-6)))

    def follow(self, x: float, y: float, yaw: float, v: float, yaw_rate: float) -> tuple[float, float]:
        """Give the speed and the steering along the track: pure pursuit."""
        px, py, speeds, spacing = self.track
        n, near = len(px), int(np.argmin((px - x) ** 2 + (py - y) ** 2))
        far = math.hypot(px[near] - x, py[near] - y)
        ahead = max(2.2 * self.base, abs(v) * (0.4 + 1.6 * self.lead)) + 0.3 * far
        goal = (near + int(ahead / spacing[0])) % n
        eta = wrap(math.atan2(py[goal] - y, px[goal] - x) - yaw)
        bend = 2 * math.sin(eta) / math.hypot(px[goal] - x, py[goal] - y)
        if abs(eta) > 1.6:
            bend = math.copysign(1.0 / self.base, eta)
        steer = math.atan(self.base * bend)
        if v > 0.2 * self.top:
            steer += 0.1 * self.base * (bend - yaw_rate / v)
        soon = (near + int(abs(v) * self.lead / spacing[0])) % n
        return min(float(speeds[soon]), self.top) * (0.5 if abs(eta) > 1.0 else 1.0), steer

    def intend(self, now: float, v: float) -> tuple[float, float, float]:
        """Give the speed, the steering and the slew of the present segment."""
        if now - self.began > self.segment.seconds:
            self.segment, self.began = next(self.plan), now
        g, t = self.segment, now - self.began
        speed = g.speed + (g.speed_end - g.speed) * t / g.seconds
        steer = g.steer + g.amplitude * math.sin(2 * math.pi * g.frequency * t)
        if speed > 0:
            widest = abs(g.steer) + 0.7 * g.amplitude
            speed = min(speed, 1.1 * math.sqrt(self.limit * self.base / math.tan(min(max(widest, 0.02), self.lock))))
            if abs(g.steer) < self.lock:
                steer = min(max(steer, -1.2 * self.lock_at(v)), 1.2 * self.lock_at(v))
        return speed, steer, g.slew

    def step(self, now: float, seen: np.ndarray) -> tuple[float, float]:
        """Give throttle and steering (left is positive), each −1…1."""
        x, y, yaw, v, side, yaw_rate = (float(value) for value in seen[:6])
        yaw += yaw_rate * self.lead
        x, y = x + v * self.lead * math.cos(yaw), y + v * self.lead * math.sin(yaw)
        if self.style == "laps" and now > 1.0:
            speed, steer = self.follow(x, y, yaw, v, yaw_rate)
            slew = 6.0
        else:
            speed, steer, slew = self.intend(now, v)
            home = wrap(math.atan2(-y, -x) - yaw)
            reach = 0.35 * abs(v) + max(self.car.driver["tightest_radius_m"], v * v / (0.7 * self.limit))
            reach = math.copysign(reach, v)
            leaves = abs(x + reach * math.cos(yaw)) > self.field[0] or abs(y + reach * math.sin(yaw)) > self.field[1]
            inside = abs(x) < self.field[0] and abs(y) < self.field[1]
            if self.returning and inside and abs(home) < 0.5 and v > 0:
                self.returning = False
            elif leaves and not self.returning and (abs(home) > 0.9 or v < 0) and speed != 0.0:
                self.returning, self.turn = True, math.copysign(1.0, home)
            if self.returning:
                self.turn = math.copysign(1.0, home) if abs(home) < 2.5 else self.turn
                calm = min(
                    1.5, 0.6 * self.base / (max(v, 0.1) * (self.lead / 0.8 + 0.1))
                )  # no weaving in spite of the delay
                wanted = 1.5 * abs(home) if abs(home) > 1.5 else calm * abs(home)
                steer = self.turn * min(wanted, self.lock, self.lock_at(v))
                speed = min(max(0.0 if math.isnan(speed) else speed, 0.4 * self.top), 0.75 * self.top)
                slew = max(slew, 4.0)
        if v > 0.3 * self.top and abs(side) > 0.45 * v:  # it slides: steer into the slide, off the throttle
            steer, speed, slew = math.atan2(side, v), math.nan, 8.0
            self.care = max(self.care * (1 - 1.5 * TICK), 0.6)  # and is more careful for the next half minute
        self.care += 2 * TICK / 30 * (1 - self.care)
        self.tremor += 0.12 * (self.rng.normal(0, self.shake * 2.5) - self.tremor)
        want = [self.throttle(now, speed, v), min(max(steer / self.lock + self.tremor, -1.0), 1.0)]
        for k, fastest in enumerate([max(slew, 3.0), slew]):
            self.sticks[k] += min(max(want[k] - self.sticks[k], -fastest * 2 * TICK), fastest * 2 * TICK)
        if want[0] == 0.0 and abs(self.sticks[0]) < 0.1:
            self.sticks[0] = 0.0
        return self.sticks[0], self.sticks[1]

    def throttle(self, now: float, speed: float, v: float) -> float:
        """Give the throttle for a speed; nan lets the vehicle coast, a negative speed reverses it."""
        p = self.car.plant
        if math.isnan(speed):
            return 0.0
        if p["drive_kind"] == 2.0:
            return min(max(speed / p["speed_controller_full_scale_m_per_s"], -1.0), 1.0)
        brakes = -0.5 if self.car.driver["brakes_with_negative_throttle"] else 0.0
        if speed <= 0.0:
            if v > 0.12 * self.top:
                self.stopped = now
                return -0.7 if speed < 0.0 else brakes
            if speed == 0.0 or now - self.stopped < 0.4:
                return 0.0
        else:
            self.stopped = now
        known = float(np.interp(abs(speed), self.table[1], self.table[0]))
        if speed < 0.0:
            return -min(known / p["reverse_share"] ** 0.5 + max(0.2 * (now - self.stopped - 0.8), 0.0), 0.7)
        if v - speed > 0.45 * self.top:
            return brakes
        error = speed - v
        stuck = v < 0.06 * self.top
        self.extra += 2 * TICK * (0.3 if stuck else 0.3 * self.gain * error - 0.4 * self.extra)
        self.extra = min(max(self.extra, -0.1), 0.6)
        return min(max(known + self.gain * error + self.extra, 0.0), max(self.care, known))


def learn_throttle(car: Vehicle) -> np.ndarray:
    """Give throttles and the speeds that the vehicle reaches with them on a straight: the driver's experience."""
    levels, ticks = np.linspace(0, 1, 11), 800
    speeds = np.zeros(len(levels))
    plant = as_record({**car.plant, "steering_trim_rad": 0.0})
    for k, level in enumerate(levels):
        trace = np.zeros((ticks * STEPS // TRACE_EVERY + 1, len(TRACE)))
        advance(at_rest(0.8), plant, np.tile([level, 0.0], (ticks + 1, 1)), 0, ticks, trace)
        speeds[k] = trace[-1, 3]
    return np.stack([levels, np.maximum.accumulate(speeds) + 1e-6 * levels])


def drive(car: Vehicle, one: dict[str, Any], table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Drive one recording; gives the trace, each millisecond, and the commands as sent, each tick."""
    rng = np.random.default_rng([53, car.number, one["seed"]])
    day, p = car.days[one["day"]], dict(car.plant)
    p["friction_coefficient"] *= day["friction_factor"]
    p["steering_trim_rad"] += day["steering_trim_change_rad"]
    for key in ("drive_kinetic_friction_n", "drive_static_friction_n", "rolling_resistance"):
        p[key] *= day["drive_friction_factor"]
    earlier = sum(r["day"] == one["day"] and r["name"] < one["name"] for r in car.recordings)
    charge = max(day["battery_charge_at_first_recording"] - 0.08 * earlier, 0.2)
    ticks, radio = int(one["seconds"] / TICK), round(car.lab["command_period_s"] / TICK)
    per = STEPS // TRACE_EVERY
    trace, sent = np.zeros((ticks * per + 1, len(TRACE))), np.zeros((ticks + 1, 2))
    trace[0, 2] = rng.uniform(-3, 3)
    state, plant = at_rest(charge, trace[0, 2]), as_record(p)
    driver = Driver(car, one["style"], rng, table)
    lag, fine = round(car.driver["reaction_s"] / TICK), car.lab["stick_steps"]
    for k in range(ticks):
        if k % 2 == 0:
            throttle, steer = driver.step(k * TICK, trace[max(k - lag, 0) * per])
        if k % radio == 0:
            sent[k] = round(throttle * fine) / fine, round(steer * fine) / fine
        else:
            sent[k] = sent[k - 1]
        advance(state, plant, sent, k, 1, trace)
    sent[ticks] = sent[ticks - 1]
    return trace, sent


def record(car: Vehicle, one: dict[str, Any], trace: np.ndarray, sent: np.ndarray) -> pd.DataFrame:
    """Give the lab's CSV of a drive."""
    rng = np.random.default_rng([54, car.number, one["seed"]])
    lab, p, day = car.lab, car.plant, car.days[one["day"]]
    rate, end = lab["frame_rate_hz"], (len(trace) - 1) / 1000
    late = lab["camera_latency_s"] + day["camera_clock_ahead_of_command_clock_s"]
    exposed = np.arange(0.3, end - 0.3, 1 / rate)
    exposed += rng.uniform(0, 1 / rate) + rng.normal(0, 1, len(exposed)).clip(-3, 3) * lab["frame_jitter_share"] / rate
    x, y, yaw = (np.interp(exposed * 1000, np.arange(len(trace)), trace[:, k]) for k in range(3))
    ahead = lab["marker_ahead_of_mid_wheelbase_m"] + p["wheelbase_m"] / 2 - p["cg_to_rear_axle_m"]
    left = lab["marker_left_of_centre_line_m"]
    x, y = x + ahead * np.cos(yaw) - left * np.sin(yaw), y + ahead * np.sin(yaw) + left * np.cos(yaw)
    fields = car.driver["field_half_sizes_m"]
    lost = (np.abs(x) > 1.4 * fields[0]) | (np.abs(y) > 1.4 * fields[1])
    lost |= rng.random(len(x)) < lab["dropped_share"]
    for start in rng.uniform(0, end, rng.poisson(lab["gaps_per_minute"] * end / 60)):
        lost |= (exposed > start) & (exposed < start + rng.uniform(0.08, 0.45))
    wave, bent = 2.5 / fields[0], lab["position_distortion_mm"] / 1000
    x, y = x + bent * np.sin(wave * y + 1), y + bent * np.sin(wave * x + 2)
    pose = np.stack([x, y, yaw + lab["marker_yaw_offset_rad"]])
    noise = np.array([lab["position_noise_mm"]] * 2 + [lab["heading_noise_mrad"]])[:, None] / 1000
    pose += noise * rng.normal(size=pose.shape)
    pose[2] = np.remainder(pose[2] + np.pi, 2 * np.pi) - np.pi
    again = rng.random(len(x)) < lab["repeated_share"]
    stale = lab["lost_poses"].startswith("stale")
    again[0], lost[0] = False, False
    keep = np.maximum.accumulate(np.where(again | (lost & stale), 0, np.arange(len(x))))
    pose, stamp = pose[:, keep], exposed + late
    if lab["rows"].startswith("at the logger"):
        rows = np.arange(math.ceil(stamp[0] * lab["logger_rate_hz"]), int(stamp[-1] * lab["logger_rate_hz"]))
        times = rows / lab["logger_rate_hz"]
        seen = np.flatnonzero(~lost)
        shown = seen[np.maximum(np.searchsorted(stamp[seen], times, side="right") - 1, 0)]
        pose, lost = pose[:, shown], np.zeros(len(times), bool)
    else:
        times = stamp
    latched = np.floor(times * lab["logger_rate_hz"]) / lab["logger_rate_hz"]
    throttle, steer = sent[np.clip((latched / TICK + 1e-6).astype(int), 0, len(sent) - 1)].T
    length, angle = {"m": 1.0, "mm": 1000.0}[lab["length_unit"]], {"rad": 1.0, "deg": 180 / np.pi}[lab["angle_unit"]]
    if lab["command_unit"] == "us":
        throttle = np.round(lab["throttle_us"][0] + lab["throttle_us"][1] * throttle)
        steer = np.round(lab["steering_us"][0] + lab["steering_us"][1] * steer)
    elif lab["command_unit"] == "si":
        throttle, steer = throttle * p["speed_controller_full_scale_m_per_s"], steer * p["steering_gain_rad"]
    elif not lab["steering_positive_left"]:
        steer = -steer
    scale, digits = {"s": (1, 4), "ms": (1e3, 1), "us": (1e6, 0)}[lab["time_unit"]]
    table = pd.DataFrame({"time": np.round((times - times[0]) * scale, digits), "throttle": np.round(throttle, 4)})
    table["steering"] = np.round(steer, 4)
    table["x"], table["y"] = np.round(pose[:2] * length, 5 if length == 1 else 2)
    table["heading"] = np.round(pose[2] * angle, 5 if angle == 1 else 3)
    if stale:
        table["valid"] = (~lost).astype(int)
    elif lab["lost_poses"] == "no row":
        table = table[~lost]
    else:
        table.loc[lost, ["x", "y", "heading"]] = np.nan
    return table


def mapping(car: Vehicle) -> str:
    """Write down what the lab would say of its recordings."""
    lab, p = car.lab, car.plant
    channels = [("normalised", 0.0, 1.0), ("normalised", 0.0, 1.0)]
    if lab["command_unit"] == "us":
        channels = [("us", *lab["throttle_us"]), ("us", lab["steering_us"][0], abs(lab["steering_us"][1]))]
    elif lab["command_unit"] == "si":
        full, lock = p["speed_controller_full_scale_m_per_s"], p["steering_gain_rad"]
        channels = [("m/s", 0.0, round(full + 0.001, 3)), ("rad", 0.0, round(lock + 0.001, 3))]
    tables = [
        f'{name} = {{ unit = "{unit}", neutral = {neutral}, low = {neutral - span}, high = {neutral + span} }}'
        for name, (unit, neutral, span) in zip(("drive", "front", "rear"), [*channels, channels[1]], strict=True)
    ]
    rate = lab["logger_rate_hz"] if lab["rows"].startswith("at the logger") else lab["frame_rate_hz"]
    flip = ", scale = -1.0" if lab["command_unit"] == "normalised" and not lab["steering_positive_left"] else ""
    half, name = round(lab["wheelbase_stated_m"] / 2, 4), f'name = "vehicle-{car.number}"'
    lines = ["schema = 1", name, "", "[vehicle]", name, 'kinematics = "two_axle"']
    lines += [f"front_axle_m = {half}", f"rear_axle_m = {half}"]
    lines += ["", "[channels]", *tables, "", "[mocap]", f"rate_hz = {rate}"]
    lines += ["", "[prediction]", "horizon_s = 2.0", "stride_s = 1.0", "", "[columns]"]
    lines += [f'time = {{ column = "time", unit = "{lab["time_unit"]}" }}']
    lines += [f'{axis} = {{ column = "{axis}", unit = "{lab["length_unit"]}" }}' for axis in "xy"]
    lines += [f'heading = {{ column = "heading", unit = "{lab["angle_unit"]}" }}']
    lines += ['drive = { column = "throttle" }', f'front = {{ column = "steering"{flip} }}']
    lines += ['tracked = { column = "valid", equals = 1 }'] * lab["lost_poses"].startswith("stale")
    lines += ["", "[runs]", 'experiment = "free"', "gap_s = 0.5", f"command_hold_s = {1 / lab['logger_rate_hz']:.4f}"]
    for day in car.days:
        lines += ["", "[[files]]", f'match = "{day["day"]}_*"', f'session = "{day["day"]}"']
    return "\n".join(lines) + "\n"


def facts(trace: np.ndarray) -> dict[str, float]:
    """Say in numbers what a drive was like."""
    speed, moving = np.hypot(trace[:, 3], trace[:, 4]), np.abs(trace[:, 3]) > 0.05
    edges = np.flatnonzero(np.diff(np.concatenate([[1], moving.astype(int), [1]])))
    numbers = {
        "highest_speed_m_per_s": speed.max(),
        "median_speed_m_per_s": np.median(speed[moving]) if moving.any() else 0.0,
        "highest_lateral_acceleration_m_per_s2": np.abs(trace[:, 7]).max(),
        "p95_lateral_acceleration_m_per_s2": np.quantile(np.abs(trace[:, 7]), 0.95),
        "highest_longitudinal_acceleration_m_per_s2": np.abs(trace[:, 6]).max(),
        "highest_yaw_rate_rad_per_s": np.abs(trace[:, 5]).max(),
        "p95_rear_slip_angle_rad": np.quantile(trace[moving, 11], 0.95) if moving.any() else 0.0,
        "share_of_time_moving": moving.mean(),
        "longest_standstill_s": (edges[1::2] - edges[::2]).max(initial=0) / 1000,
        "share_of_time_reversing": (trace[:, 3] < -0.05).mean(),
        "farthest_from_centre_m": np.abs(trace[:, :2]).max(),
    }
    return {key: round(float(value), 4) for key, value in numbers.items()}


def truth(car: Vehicle) -> dict[str, Any]:
    """Give everything that the lab does not know."""
    p: dict[str, Any] = dict(car.plant)
    p |= {"drive_kind": DRIVES[int(p["drive_kind"])], "tyre_model": TYRES[int(p["tyre_model"])]}
    p |= {"negative_throttle": NEGATIVE[int(p["negative_throttle"])]}
    p["all_wheel_drive"] = "one rigid shaft" if p["all_wheel_drive"] else "no: the rear axle drives"
    p["motor_brakes_at_part_throttle"] = bool(p["motor_brakes_at_part_throttle"])
    if car.plant["drive_kind"] == 2:
        unused = ("brake", "drag_brake", "negative", "motor_brakes", "throttle_expo")
        p = {key: value for key, value in p.items() if not key.startswith(unused)}
    else:
        p = {key: value for key, value in p.items() if not key.startswith("speed_controller")}
    if p["tyre_model"] == "Fiala":
        p = {key: value for key, value in p.items() if not key.startswith("pacejka")}
    total = {"from_command_to_pose_stamp_steering_s": p["steering_latency_s"] + car.lab["camera_latency_s"]}
    total["from_command_to_pose_stamp_throttle_s"] = p["throttle_latency_s"] + car.lab["camera_latency_s"]
    found = {"vehicle": car.number, "scale": f"1:{car.scale}", "physics": p, "delays_without_clock_offset": total}
    return {**found, "laboratory": car.lab, "driver": car.driver, "days": car.days, "recordings": car.recordings}


def write(folder: Path, number: int) -> dict[str, Any]:
    """Write a vehicle's recordings, its mapping and its truth; gives the truth."""
    car = draw_vehicle(number)
    folder.mkdir(parents=True, exist_ok=True)
    table = learn_throttle(car)
    for one in car.recordings:
        trace, sent = drive(car, one, table)
        one["what_happened"] = facts(trace)
        record(car, one, trace, sent).to_csv(folder / f"{one['name']}.csv", index=False)
    (folder / "mapping.toml").write_text(mapping(car), encoding="utf-8")
    known = truth(car)
    (folder / "truth.json").write_text(json.dumps(known, indent=2, default=float), encoding="utf-8")
    return known


def describe(number: int) -> str:
    """Describe a vehicle in a line, without driving it."""
    car = draw_vehicle(number)
    p, lab, d = car.plant, car.lab, car.driver
    kind = ["voltage", "torque", "speed PI"][int(p["drive_kind"])] + (" AWD" if p["all_wheel_drive"] else " RWD")
    styles = ", ".join(dict.fromkeys(one["style"] for one in car.recordings))
    words = [f"{number:3d}", f"1:{car.scale:<2d}", f"{p['wheelbase_m']:.2f} m", f"{kind:12s}"]
    words += [f"{d['top_speed_m_per_s']:.1f} m/s", f"mu {p['friction_coefficient']:.2f}"]
    words += [f"used {d['share_of_grip_used']:.2f}", f"latency {1e3 * p['steering_latency_s']:3.0f} ms"]
    words += [f"{lab['frame_rate_hz']:3.0f} Hz", f"{lab['position_noise_mm']:4.1f} mm"]
    words += [f"{lab['heading_noise_mrad']:4.1f} mrad", f"{lab['command_unit']:10s}"]
    return "  ".join([*words, f"{len(car.recordings)} on {len(car.days)} days: {styles}"])


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    one = commands.add_parser("write", help="write a vehicle's recordings, mapping.toml and truth.json")
    one.add_argument("folder", type=Path)
    one.add_argument("--vehicle", type=int, required=True)
    many = commands.add_parser("list", help="print a line per vehicle")
    many.add_argument("--first", type=int, default=1)
    many.add_argument("--last", type=int, default=12)
    given = parser.parse_args()
    if given.command == "write":
        write(given.folder, given.vehicle)
    else:
        for number in range(given.first, given.last + 1):
            print(describe(number))


if __name__ == "__main__":
    main()
