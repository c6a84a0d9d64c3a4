#!/usr/bin/env python3
"""Simulator of a front-steered model car under motion capture.

    front_steered.py list
    front_steered.py write DIR --vehicle N [--causes a,b] [--scale S] [--seed K]

The vehicle is a planar rigid body on four wheels. Each wheel resists sideways motion with a (stiff) tyre force, the
motor turns the driven wheels through open differentials, and the servo turns the front wheels through an imperfect
Ackermann linkage. The three velocities of the body (forward, left, yaw) follow from Newton's equations, integrated with
a linear-implicit step of 2 ms for all runs of a campaign at once. The implicit step makes stiff tyres harmless:
without a cause, the motion is that of a kinematic single-track vehicle within a millimetre or two.

A *cause* is an entry of `CAUSES`. It changes `Parameters` of the plant or of the camera; the neutral values of
`Parameters` describe the vehicle without any cause. A parameter may be a number or an array with one value per run,
so that causes of kind "time" use the same equations as the others.

Angles are in radians, x is forward, y is left. `u` denotes commands from -1 to 1 (of the command's full travel).
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd

DT = 0.002  # integration step [s]
NEUTRAL_US = 1500.0
PRE_ROLL_S = 0.6  # simulated time before the first command
POST_ROLL_S = 1.3  # and after the last one
FLOOR_HALF_M = 2.45  # the runs are planned to stay within this distance of the middle
CREEP_MPS = 0.02  # below this speed, tyre forces and "moving" fade out smoothly
GRAVITY = 9.81
FRONT = slice(0, 2)  # wheels 0, 1 are front left and right; 2, 3 are rear left and right
REAR = slice(2, 4)


# ---------------------------------------------------------------------------------------------------------------------
# Vehicle


@dataclass
class Vehicle:
    """An individual car, drawn by its number, with its camera and its repeatability."""

    number: int
    driven: str = "rear"
    wheelbase: float = 0.0
    track: float = 0.0
    mass: float = 0.0
    yaw_inertia: float = 0.0
    cg_from_rear: float = 0.0
    marker_from_rear: float = 0.0
    stated_front: float = 0.0
    stated_rear: float = 0.0
    tyre_coefficient: float = 0.0  # cornering stiffness per load [1/rad]
    ackermann: float = 0.0  # 0 = parallel wheels, 1 = perfect
    drive_stiffness: float = 0.0  # force per speed difference of motor and wheels [N s/m]
    servo_tau: float = 0.0
    esc_tau: float = 0.0
    drive_span_us: float = 0.0
    front_span_us: float = 0.0
    speed_forward: tuple = ()  # (greatest speed, exponent, saturation)
    speed_backward: tuple = ()
    angle_curve: tuple = ()  # (greatest angle, roundness, asymmetry)
    trim: float = 0.0
    rate_hz: float = 0.0
    position_noise: float = 0.0
    heading_noise: float = 0.0
    speed_spread: float = 0.0
    trim_spread: float = 0.0

    @classmethod
    def draw(cls, number: int) -> Vehicle:
        """Vehicle `number`; the same number always gives the same vehicle."""
        rng = np.random.default_rng([number, 0xCA7])
        uniform = lambda low, high: float(rng.uniform(low, high))  # noqa: E731
        log_uniform = lambda low, high: float(np.exp(rng.uniform(np.log(low), np.log(high))))  # noqa: E731
        v = cls(number)
        v.driven = "rear" if rng.random() < 0.7 else "both"  # seven of ten vehicles have rear-wheel drive
        v.wheelbase = uniform(0.20, 0.28)
        v.track = v.wheelbase * uniform(0.58, 0.70)
        v.mass = uniform(1.2, 2.4)
        v.cg_from_rear = v.wheelbase * uniform(0.42, 0.58)
        v.yaw_inertia = v.mass * (0.42 * v.wheelbase) ** 2
        v.marker_from_rear = v.wheelbase * uniform(0.25, 0.75)
        v.stated_front = v.wheelbase - v.marker_from_rear + uniform(0.001, 0.002) * rng.choice([-1, 1])
        v.stated_rear = v.marker_from_rear + uniform(0.001, 0.002) * rng.choice([-1, 1])
        v.tyre_coefficient = uniform(260.0, 340.0)
        v.ackermann = uniform(0.8, 0.97)
        v.drive_stiffness = v.mass / 0.0004
        v.servo_tau = uniform(0.001, 0.005)
        v.esc_tau = uniform(0.001, 0.005)
        v.drive_span_us = float(rng.integers(400, 501))
        v.front_span_us = float(rng.integers(400, 501))
        v.speed_forward = (uniform(1.0, 1.2), uniform(1.05, 1.25), uniform(0.2, 0.6))
        v.speed_backward = (uniform(0.75, 1.0), uniform(1.0, 1.2), uniform(0.1, 0.5))
        v.angle_curve = (np.radians(uniform(25.0, 29.0)), uniform(0.5, 1.0), uniform(-0.07, 0.07))
        v.trim = np.radians(uniform(-1.5, 1.5))
        v.rate_hz = float(rng.choice([60.0, 100.0, 120.0, 150.0, 200.0]))
        v.position_noise = uniform(0.0001, 0.0004)
        v.heading_noise = uniform(0.0003, 0.0015)
        v.speed_spread = log_uniform(0.002, 0.006)
        v.trim_spread = np.radians(log_uniform(0.02, 0.1))
        return v

    @property
    def unsteadiness(self) -> float:
        """From 0 (repeats as well as any vehicle) to 1 (as badly as any)."""
        speed = np.log(self.speed_spread / 0.002) / np.log(3.0)
        trim = np.log(self.trim_spread / np.radians(0.02)) / np.log(5.0)
        return float(0.3 * speed + 0.7 * trim)

    def speed(self, u: np.ndarray) -> np.ndarray:
        """Static curve: speed of the driven axle(s) [m/s] for drive command u."""
        size = np.abs(u)

        def branch(top: float, exponent: float, saturation: float) -> np.ndarray:
            return top * size**exponent * (1 + saturation) / (1 + saturation * size * size)

        return np.where(u >= 0, branch(*self.speed_forward), -branch(*self.speed_backward))

    def angle(self, u: np.ndarray) -> np.ndarray:
        """Static curve: mean angle of the front wheels [rad] for steering command u, without trim."""
        greatest, roundness, asymmetry = self.angle_curve
        return greatest * np.sin(roundness * (u + asymmetry * u * u)) / np.sin(roundness)

    def wheel_angles(self, mean: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angles of the left and the right front wheel for a mean angle."""
        tangent = np.tan(mean)
        shift = 0.5 * self.track * tangent
        left = np.arctan(self.wheelbase * tangent / (self.wheelbase - shift))
        right = np.arctan(self.wheelbase * tangent / (self.wheelbase + shift))
        return mean + self.ackermann * (left - mean), mean + self.ackermann * (right - mean)


# ---------------------------------------------------------------------------------------------------------------------
# Parameters and causes


@dataclass
class Parameters:
    """What causes change. Each neutral value switches its term off. Numbers, or arrays with a value for each run."""

    # Commands
    delay: float = 0.0  # [s]
    radio_period: float = 0.0  # packets carry the command at multiples of this time [s]
    shadow: tuple = ()  # (x, y, radius, further delay) of a region with bad radio
    mixing: float = 0.0  # part of the drive command that is added to the steering command
    # Steering
    deadband: float = 0.0  # changes of the command below this are ignored
    steering_gain: float = 1.0
    reverse_gain: float = 1.0
    trim: float = 0.0
    trim_by_direction: float = 0.0  # added forward, subtracted backward
    trim_by_heading: float = 0.0  # per rad of heading turned since the start
    servo_tau: float = 0.0
    servo_rate: float = np.inf  # [rad/s]
    backlash: float = 0.0  # full gap [rad]
    creep_part: float = 0.0
    creep_tau: float = 1.0
    saver_limit: float = np.inf  # angle beyond which the servo saver slips
    saver_slip: float = 0.0
    gyro_gain: float = 0.0  # [rad per rad/s]
    understeer: float = 0.0  # K of 1 + K v² [s²/m²]
    # Drive
    speed_factor: float = 1.0
    tau_up: float = 0.0
    tau_down: float = 0.0
    launch_limit: float = np.inf  # [m/s²]
    coast_limit: float = np.inf  # deceleration with the drive command at neutral [m/s²]
    reverse_pause: float = 0.0  # [s]
    start_wait: float = 0.0  # wait before a start from rest at full drive [s]; longer at lower commands
    corner_loss: float = 0.0
    polarisation: float = 0.0
    polarisation_tau: float = 1.0
    bec_loss: float = 0.0  # part of the speed lost by a full travel of the servo
    bec_tau: float = 0.4
    # Tyres, floor and cable
    tyre_coefficient: float = 0.0  # 0 = that of the vehicle
    front_friction: float = np.inf
    rear_play: float = 0.0  # the rear axle turns by up to this angle
    drift: tuple = (0.0, 0.0)  # [m/s]
    dip: tuple = ()  # (x, y, drift towards it per metre)
    patch: tuple = ()  # (normal's angle, middle, half width, part of the speed lost)
    tether: tuple = ()  # (x, y, slack, change of speed per metre beyond it)
    # Camera
    latency: float = 0.0
    offset: tuple = (0.0, 0.0)
    misalignment: float = 0.0
    scale: float = 1.0
    distortion: tuple = ()  # (x, y, k)
    skew: float = 0.0
    occlusion: tuple = ()  # (normal's angle, middle, half width, forward, left, turn)


@dataclass(frozen=True)
class Size:
    """Range of a cause's size. `scaling`: "up" (larger is stronger), "down" (smaller is), "fixed" or "sign"."""

    low: float
    high: float
    unit: str = ""
    scaling: str = "up"

    def draw(self, rng: np.random.Generator, scale: float, least: float) -> float:
        """A size from the stronger part of the range that `least` leaves: 0 is all of it, 1 the strong end only."""
        if self.scaling == "sign":
            return float(rng.choice([-1.0, 1.0]))
        part = rng.random()
        if self.scaling == "up":
            part = least + (1 - least) * part
        elif self.scaling == "down":
            part = (1 - least) * part
        value = float(self.low + (self.high - self.low) * part)
        return {"up": value * scale, "down": value / scale, "fixed": value}[self.scaling]


SIGN = Size(-1, 1, "sign", "sign")
ANGLE = Size(-np.pi, np.pi, "rad", "fixed")


def fixed(low: float, high: float, unit: str = "") -> Size:
    return Size(low, high, unit, "fixed")


@dataclass(frozen=True)
class Cause:
    name: str
    kind: str
    text: str
    sizes: dict[str, Size]
    apply: Callable  # (parameters, drawn sizes, session)

    def draw(self, vehicle: Vehicle, scale: float) -> dict[str, float]:
        """The sizes for a vehicle, independent of the other causes; larger for a vehicle that repeats badly."""
        rng = np.random.default_rng([vehicle.number, zlib.crc32(self.name.encode())])
        least = 0.8 * vehicle.unsteadiness
        return {name: size.draw(rng, scale, least) for name, size in self.sizes.items()}


CAUSES: dict[str, Cause] = {}


def cause(name: str, kind: str, text: str, **sizes: Size) -> Callable:
    """Register the decorated function `(p, s, session)`, which changes the parameters p by the sizes s."""

    def register(function: Callable) -> Callable:
        CAUSES[name] = Cause(name, kind, text, sizes, function)
        return function

    return register


# Inside


@cause("actuation_delay", "inside", "all actuators obey later", delay=Size(0.13, 0.2, "s"))
def _(p, s, session):
    p.delay = p.delay + s.delay


@cause("steering_lag", "inside", "first-order servo", tau=Size(0.15, 0.28, "s"))
def _(p, s, session):
    p.servo_tau = p.servo_tau + s.tau


@cause("steering_rate_limit", "inside", "the servo turns slowly", rate=Size(0.45, 0.7, "rad/s", "down"))
def _(p, s, session):
    p.servo_rate = np.minimum(p.servo_rate, s.rate)


@cause("steering_backlash", "inside", "the wheels follow the servo within a gap", gap=Size(0.04, 0.065, "rad"))
def _(p, s, session):
    p.backlash = p.backlash + s.gap


@cause("reverse_steering_gain", "inside", "another steering gain backward", change=Size(0.07, 0.14), sign=SIGN)
def _(p, s, session):
    p.reverse_gain = p.reverse_gain * (1 + s.sign * s.change)


@cause(
    "speed_lag",
    "inside",
    "first-order speed, other constants up and down",
    up=Size(0.22, 0.40, "s"),
    down=Size(0.05, 0.10, "s"),
)
def _(p, s, session):
    p.tau_up = p.tau_up + s.up
    p.tau_down = p.tau_down + s.down


@cause("cornering_speed_loss", "inside", "speed falls with the tangent of the wheel angle", loss=Size(0.25, 0.45))
def _(p, s, session):
    p.corner_loss = p.corner_loss + s.loss


@cause("battery_droop", "inside", "speed falls with the hours of the session", per_hour=Size(0.06, 0.10, "1/h"))
def _(p, s, session):
    p.speed_factor = p.speed_factor * (1 - s.per_hour * session.hours)


@cause("lateral_slip", "inside", "yaw rate is divided by 1 + K v²", k=Size(0.25, 0.5, "s²/m²"))
def _(p, s, session):
    p.understeer = p.understeer + s.k


@cause("floor_tilt", "inside", "a moving vehicle is carried along", speed=Size(0.03, 0.05, "m/s"), direction=ANGLE)
def _(p, s, session):
    p.drift = (p.drift[0] + s.speed * np.cos(s.direction), p.drift[1] + s.speed * np.sin(s.direction))


@cause("mocap_latency", "inside", "the camera's poses are late", latency=Size(0.12, 0.18, "s"))
def _(p, s, session):
    p.latency = p.latency + s.latency


@cause("marker_offset", "inside", "the tracked point is elsewhere", distance=Size(0.065, 0.09, "m"), direction=ANGLE)
def _(p, s, session):
    p.offset = (p.offset[0] + s.distance * np.cos(s.direction), p.offset[1] + s.distance * np.sin(s.direction))


@cause("heading_misalignment", "inside", "the rigid body is turned", angle=Size(0.05, 0.08, "rad"), sign=SIGN)
def _(p, s, session):
    p.misalignment = p.misalignment + s.sign * s.angle


@cause("mocap_scale", "inside", "the camera's metres are longer", excess=Size(0.05, 0.08, "its metre is 1 + excess"))
def _(p, s, session):
    p.scale = p.scale / (1 + s.excess)


# Outside: servo, linkage, electronics and radio


@cause(
    "servo_deadband",
    "outside",
    "the servo ignores changes of its command below a band, then goes all the way",
    band=Size(0.24, 0.36, "of full steering"),
)
def _(p, s, session):
    p.deadband = s.band


@cause(
    "linkage_creep",
    "outside",
    "a held wheel angle creeps back (rubber in the linkage) and later overshoots back",
    part=Size(0.09, 0.15),
    tau=fixed(1.0, 2.0, "s"),
)
def _(p, s, session):
    p.creep_part, p.creep_tau = s.part, s.tau


@cause(
    "servo_saver_slip",
    "outside",
    "beyond a wheel angle the servo saver slips, and stays so until the other end",
    slip=Size(0.022, 0.04, "rad"),
    limit=fixed(0.24, 0.30, "rad"),
)
def _(p, s, session):
    p.saver_slip, p.saver_limit = s.slip, s.limit


@cause(
    "channel_mixing",
    "outside",
    "a part of the drive command leaks into the steering channel",
    part=Size(0.04, 0.07, "of full commands"),
    sign=SIGN,
)
def _(p, s, session):
    p.mixing = s.sign * s.part


@cause(
    "gyro_left_on",
    "outside",
    "a driving gyro counter-steers the yaw rate, with 30 ms of lag",
    gain=Size(0.025, 0.045, "rad per rad/s"),
)
def _(p, s, session):
    p.gyro_gain = s.gain


@cause(
    "dragging_wheel",
    "outside",
    "a tight front wheel pulls the steering: to one side forward, the other backward",
    angle=Size(0.011, 0.02, "rad"),
    sign=SIGN,
)
def _(p, s, session):
    p.trim_by_direction = s.sign * s.angle


@cause(
    "cable_windup",
    "outside",
    "a cable that winds up with the heading turned in the run pulls the steering back",
    per_rad=Size(0.02, 0.035, "rad/rad"),
)
def _(p, s, session):
    p.trim_by_heading = s.per_rad


@cause(
    "bec_sag",
    "outside",
    "each movement of the servo takes speed, which recovers with a time constant",
    loss=Size(0.5, 0.75, "of the speed for the full angle"),
    tau=fixed(0.4, 0.7, "s"),
)
def _(p, s, session):
    p.bec_loss, p.bec_tau = s.loss, s.tau


@cause(
    "slow_radio_frames",
    "outside",
    "commands arrive with packets of a slow clock that is not that of the runs",
    period=Size(0.36, 0.56, "s"),
)
def _(p, s, session):
    p.radio_period = np.maximum(p.radio_period, s.period)


@cause(
    "radio_shadow",
    "outside",
    "within a region of the room, commands arrive late",
    delay=Size(0.25, 0.4, "s"),
    x=fixed(-0.8, 0.8, "m"),
    y=fixed(-0.8, 0.8, "m"),
    radius=fixed(1.2, 1.6, "m"),
)
def _(p, s, session):
    p.shadow = (s.x, s.y, s.radius, s.delay)


# Outside: drive train and battery


@cause(
    "esc_soft_start",
    "outside",
    "the ESC limits the acceleration, not the braking",
    limit=Size(0.9, 1.4, "m/s²", "down"),
)
def _(p, s, session):
    p.launch_limit = s.limit


@cause(
    "coast_down",
    "outside",
    "at neutral drive the ESC does not brake: constant deceleration by friction",
    deceleration=Size(0.8, 1.4, "m/s²", "down"),
)
def _(p, s, session):
    p.coast_limit = s.deceleration


@cause(
    "esc_reverse_pause",
    "outside",
    "the ESC brakes for a while before it drives in the other direction",
    pause=Size(0.15, 0.35, "s"),
)
def _(p, s, session):
    p.reverse_pause = s.pause


@cause(
    "cogging_start",
    "outside",
    "a sensorless motor stutters before each start from rest, longer at low commands",
    wait=Size(0.08, 0.13, "s at full drive, divided by the drive command"),
)
def _(p, s, session):
    p.start_wait = s.wait


@cause(
    "battery_polarisation",
    "outside",
    "speed sags under load with a memory of seconds, and recovers at rest",
    part=Size(0.13, 0.21, "at full speed"),
    tau=fixed(1.5, 3.0, "s"),
)
def _(p, s, session):
    p.polarisation, p.polarisation_tau = s.part, s.tau


# Outside: tyres, axles, floor and cable


@cause(
    "grip_limit",
    "outside",
    "dusty front tyres plough at a friction limit (on tyres of ordinary stiffness)",
    friction=Size(0.055, 0.085, "", "down"),
)
def _(p, s, session):
    p.front_friction = s.friction
    p.tyre_coefficient = p.tyre_coefficient or 15.0


@cause(
    "soft_tyres",
    "outside",
    "soft tyres on both axles: the car crabs outward, without understeer",
    coefficient=Size(0.85, 1.25, "1/rad", "down"),
)
def _(p, s, session):
    p.tyre_coefficient = s.coefficient


@cause(
    "rear_axle_play",
    "outside",
    "the rear axle turns within its play, to the side of the side force",
    play=Size(0.03, 0.055, "rad"),
)
def _(p, s, session):
    p.rear_play = s.play


@cause(
    "slippery_patch",
    "outside",
    "on a strip of the floor the driven wheels spin: lower speed",
    loss=Size(0.11, 0.2),
    direction=ANGLE,
    middle=fixed(-0.6, 0.6, "m"),
    half_width=fixed(0.5, 0.8, "m"),
)
def _(p, s, session):
    p.patch = (s.direction, s.middle, s.half_width, s.loss)


@cause(
    "tether_pull",
    "outside",
    "beyond its slack, a cable brakes on the way out and helps on the way in",
    per_metre=Size(0.09, 0.16, "m/s per m"),
    x=fixed(-0.8, 0.8, "m"),
    y=fixed(-0.8, 0.8, "m"),
    slack=fixed(0.3, 0.6, "m"),
)
def _(p, s, session):
    p.tether = (s.x, s.y, s.slack, s.per_metre)


@cause(
    "floor_dip",
    "outside",
    "the floor sinks towards a point: a moving vehicle drifts to it, more the farther away",
    per_metre=Size(0.025, 0.045, "m/s per m"),
    x=fixed(-0.8, 0.8, "m"),
    y=fixed(-0.8, 0.8, "m"),
)
def _(p, s, session):
    p.dip = (s.x, s.y, s.per_metre)


# Outside: camera


@cause(
    "lens_distortion",
    "outside",
    "radial distortion about the camera's axis",
    k=Size(0.01, 0.018, "1/m²"),
    x=fixed(-0.6, 0.6, "m"),
    y=fixed(-0.6, 0.6, "m"),
)
def _(p, s, session):
    p.distortion = (s.x, s.y, s.k)


@cause("axes_not_square", "outside", "the camera's axes are not at right angles", skew=Size(0.065, 0.1), sign=SIGN)
def _(p, s, session):
    p.skew = s.sign * s.skew


@cause(
    "occluded_marker",
    "outside",
    "in a strip of the room a marker is hidden: the centroid and the heading jump",
    shift=Size(0.085, 0.13, "m"),
    bearing=ANGLE,
    turn=Size(0.04, 0.07, "rad"),
    direction=ANGLE,
    middle=fixed(-0.8, 0.8, "m"),
    half_width=fixed(0.5, 0.8, "m"),
)
def _(p, s, session):
    forward, left = s.shift * np.cos(s.bearing), s.shift * np.sin(s.bearing)
    p.occlusion = (s.direction, s.middle, s.half_width, forward, left, s.turn)


# Time: `session.part` runs from 0 to 1 over the campaign, `session.hours` from 0 to its length


def _between(session: SimpleNamespace, begin: float, length: float) -> np.ndarray:
    return (session.part >= begin) & (session.part < begin + length)


@cause("steering_gain_fade", "time", "the steering gain fades over the campaign", loss=Size(0.11, 0.19, "at the end"))
def _(p, s, session):
    p.steering_gain = p.steering_gain * (1 - s.loss * session.part)


@cause(
    "trim_step",
    "time",
    "a collision bends the linkage: the trim jumps",
    angle=Size(0.017, 0.03, "rad"),
    sign=SIGN,
    at=fixed(0.35, 0.65, "of the campaign"),
)
def _(p, s, session):
    p.trim = p.trim + s.sign * s.angle * (session.part >= s.at)


@cause(
    "battery_swap",
    "time",
    "another battery: the speed jumps",
    change=Size(0.07, 0.12),
    sign=SIGN,
    at=fixed(0.35, 0.65, "of the campaign"),
)
def _(p, s, session):
    p.speed_factor = p.speed_factor * (1 + s.sign * s.change * (session.part >= s.at))


@cause(
    "wet_floor_part",
    "time",
    "understeer on a wet floor, in a part of the campaign only",
    k=Size(0.35, 0.55, "s²/m²"),
    begin=fixed(0.2, 0.45, "of the campaign"),
    length=fixed(0.25, 0.4, "of the campaign"),
)
def _(p, s, session):
    p.understeer = p.understeer + s.k * _between(session, s.begin, s.length)


@cause(
    "busy_radio_part",
    "time",
    "slow radio packets in a part of the campaign only",
    period=Size(0.4, 0.55, "s"),
    begin=fixed(0.2, 0.45, "of the campaign"),
    length=fixed(0.25, 0.4, "of the campaign"),
)
def _(p, s, session):
    p.radio_period = np.maximum(p.radio_period, s.period * _between(session, s.begin, s.length))


@cause(
    "cyclic_trim",
    "time",
    "the trim follows a cycle of the room (sun, air conditioning)",
    amplitude=Size(0.022, 0.036, "rad"),
    period=fixed(0.35, 0.8, "h"),
    phase=ANGLE,
)
def _(p, s, session):
    p.trim = p.trim + s.amplitude * np.sin(2 * np.pi * session.hours / s.period + s.phase)


@cause(
    "cyclic_speed",
    "time",
    "the speed follows a cycle (heating of the motor between pauses)",
    amplitude=Size(0.06, 0.10),
    period=fixed(0.35, 0.8, "h"),
    phase=ANGLE,
)
def _(p, s, session):
    p.speed_factor = p.speed_factor * (1 + s.amplitude * np.sin(2 * np.pi * session.hours / s.period + s.phase))


@cause(
    "cold_motor",
    "time",
    "stiff grease: slow at first, warms up",
    loss=Size(0.17, 0.24, "at the beginning"),
    tau=fixed(0.4, 0.7, "h"),
)
def _(p, s, session):
    p.speed_factor = p.speed_factor * (1 - s.loss * np.exp(-session.hours / s.tau))


@cause(
    "cold_servo",
    "time",
    "a servo with lag that vanishes as it warms up",
    lag=Size(0.5, 0.8, "s at the beginning"),
    tau=fixed(0.6, 1.0, "h"),
)
def _(p, s, session):
    p.servo_tau = p.servo_tau + s.lag * np.exp(-session.hours / s.tau)


@cause(
    "plate_knock",
    "time",
    "the marker plate is knocked: from then on the measured heading is turned",
    angle=Size(0.055, 0.08, "rad"),
    sign=SIGN,
    at=fixed(0.35, 0.65, "of the campaign"),
)
def _(p, s, session):
    p.misalignment = p.misalignment + s.sign * s.angle * (session.part >= s.at)


@cause("linkage_wear", "time", "play of the steering that grows from nothing", gap=Size(0.07, 0.11, "rad at the end"))
def _(p, s, session):
    p.backlash = p.backlash + s.gap * session.part


@cause(
    "battery_knee",
    "time",
    "the speed holds and then falls steeply towards the end",
    loss=Size(0.20, 0.32, "at the end"),
    knee=fixed(0.6, 0.75, "of the campaign"),
)
def _(p, s, session):
    p.speed_factor = p.speed_factor * (1 - s.loss * np.clip((session.part - s.knee) / (1 - s.knee), 0, None) ** 1.5)


# ---------------------------------------------------------------------------------------------------------------------
# The plan of a campaign


@dataclass
class Sequence:
    """A command sequence: from each time on, the drive and the steering command (from -1 to 1)."""

    name: str
    experiment: str
    rows: list[tuple[float, float, float]] = field(default_factory=list)
    repeats: int = 2

    def us(self, vehicle: Vehicle) -> np.ndarray:
        """Rows (time, drive, front) in µs, rounded as a radio would."""
        rows = np.array(self.rows, float)
        rows[:, 0] = np.round(rows[:, 0], 2)
        rows[:, 1] = NEUTRAL_US + np.round(rows[:, 1] * vehicle.drive_span_us)
        rows[:, 2] = NEUTRAL_US + np.round(rows[:, 2] * vehicle.front_span_us)
        return rows


class Planner:
    """Draws the command sequences of a vehicle."""

    def __init__(self, vehicle: Vehicle):
        self.vehicle = vehicle
        self.rng = np.random.default_rng([vehicle.number, 0x9147])
        self.sequences: list[Sequence] = []

    def _near(self, level: float, spread: float = 0.04) -> float:
        return float(np.clip(level + self.rng.uniform(-spread, spread), -1, 1))

    def _seconds(self, drive: float, metres: float) -> float:
        """Driving time for about a distance, such that the run takes 3 to 6 s."""
        speed = abs(float(self.vehicle.speed(np.float64(drive))))
        return float(np.clip(metres / speed, 2.8, 5.2)) + self.rng.uniform(-0.2, 0.2)

    def _add(self, experiment: str, name: str, rows: list[tuple[float, float, float]]) -> None:
        """Add a sequence; half of the sequences steer to their first angle before they start to drive."""
        if self.rng.random() < 0.5:
            lead = round(self.rng.uniform(0.25, 0.4), 2)
            rows = [(0.0, 0.0, rows[0][2])] + [(t + lead, drive, front) for t, drive, front in rows]
        end, _, front = rows[-1]
        rows.append((end + 0.3, 0.0, 0.0))  # the steering returns after the stop
        self.sequences.append(Sequence(f"{experiment}-{name}", experiment, rows))

    def plan(self) -> list[Sequence]:
        self._held()
        self._straights()
        self._steps_of_steering()
        self._waves()
        self._steps_of_drive()
        self._stops_and_reversals()
        self._draw_repeats()
        return self.sequences

    def _held(self) -> None:
        for drive, levels in (
            (0.38, (-1, -0.6, -0.25, 0.3, 0.65, 1)),
            (0.7, (-0.95, -0.5, -0.2, 0.25, 0.55, 1)),
            (0.97, (-0.8, -0.35, 0.4, 0.75)),
            (-0.45, (-1, -0.5, 0.3, 0.8)),
            (-0.8, (-0.7, 0.4, 1)),
        ):
            for level in levels:
                u, w = self._near(drive, 0.03), self._near(level)
                seconds = self._seconds(u, 3.2)
                self._add("held", f"{drive:+.2f}-{level:+.2f}", [(0, u, w), (seconds, 0, w)])

    def _straights(self) -> None:
        for level in (0.19, 0.3, 0.42, 0.58, 0.78, 1, -0.22, -0.4, -0.65, -0.95):
            u = self._near(level, 0.02)
            self._add("straight", f"{level:+.2f}", [(0, u, 0), (self._seconds(u, 3.2), 0, 0)])

    def _steps_of_steering(self) -> None:
        for number, (drive, levels) in enumerate(
            (
                (0.5, (0, 0.7, 0.2)),
                (0.75, (0.5, -0.5)),
                (0.9, (0, -0.6, 0.3)),
                (0.4, (-0.8, 0.2, 0.9)),
                (-0.5, (0.6, -0.3)),
                (-0.8, (0, 0.5)),
            )
        ):
            u, seconds = self._near(drive), self._seconds(drive, 3.0)
            rows = [(k * seconds / len(levels), u, self._near(w)) for k, w in enumerate(levels)]
            self._add("steering_step", str(number), [*rows, (seconds, 0, rows[-1][2])])

    def _waves(self) -> None:
        """Slaloms and S-curves, with a command each 50 ms."""
        shapes = (
            ("slalom", 0.45, 0.7, 3),
            ("slalom", 0.7, 0.5, 4),
            ("slalom", 0.9, 0.35, 2),
            ("slalom", -0.6, 0.6, 2),
            ("s_curve", 0.5, 0.9, 1),
            ("s_curve", 0.75, -0.7, 1),
            ("s_curve", 0.95, 0.5, 1),
            ("s_curve", -0.55, 0.8, 1),
        )
        for number, (experiment, drive, amplitude, cycles) in enumerate(shapes):
            u, top, seconds = self._near(drive), self._near(amplitude, 0.06), round(self._seconds(drive, 3.4), 2)
            times = np.arange(0, seconds - 0.02, 0.05)
            wave = top * np.sin(2 * np.pi * cycles * times / seconds)
            self._add(experiment, str(number), [*zip(times, [u] * len(times), wave, strict=True), (seconds, 0.0, 0.0)])

    def _steps_of_drive(self) -> None:
        for number, (levels, steer) in enumerate(
            (
                ((0.3, 0.8), 0),
                ((0.9, 0.35), 0),
                ((0.4, 0.75, 0.25), 0),
                ((0.35, 0.85), 0.6),
                ((0.8, 0.4), -0.45),
                ((-0.35, -0.8), -0.3),
            )
        ):
            levels, w = [self._near(u) for u in levels], self._near(steer) if steer else 0.0
            seconds = self._seconds(np.mean(levels), 3.0) / len(levels)
            rows = [(k * seconds, u, w) for k, u in enumerate(levels)]
            self._add("drive_step", str(number), [*rows, (len(levels) * seconds, 0, w)])

    def _stops_and_reversals(self) -> None:
        shapes = (
            ("stop_restart", (0.6, 0.6), 0),
            ("stop_restart", (0.5, 0.8), 0.6),
            ("stop_restart", (0.8, 0.4, 0.6), -0.4),
            ("stop_restart", (-0.5, -0.7), 0.3),
            ("reversal", (0.6, -0.6), 0),
            ("reversal", (0.7, -0.7), 0.7),
            ("reversal", (-0.5, 0.5), -0.6),
            ("reversal", (0.8, -0.5, 0.5), 0.35),
        )
        for number, (experiment, levels, steer) in enumerate(shapes):
            w, rows, time = self._near(steer) if steer else 0.0, [], 0.0
            direct = experiment == "reversal" and number % 2 == 0  # without a pause at neutral
            for drive in levels:
                rows.append((time, self._near(drive), w))
                time += self.rng.uniform(1.5, 1.9) if len(levels) == 2 else self.rng.uniform(1.1, 1.4)
                if not direct or drive == levels[-1]:
                    rows.append((time, 0.0, w))
                    time += self.rng.uniform(0.35, 0.6)
            self._add(experiment, str(number), rows)

    def _draw_repeats(self) -> None:
        """Two to four repeats, 130 to 170 runs in all."""
        for sequence in self.sequences:
            sequence.repeats = int(self.rng.choice([2, 3, 4], p=[0.5, 0.35, 0.15]))
        while not 130 <= (total := sum(s.repeats for s in self.sequences)) <= 170:
            sequence = self.sequences[self.rng.integers(len(self.sequences))]
            sequence.repeats = int(np.clip(sequence.repeats + (1 if total < 130 else -1), 2, 4))


@dataclass
class Session:
    """The runs of a campaign in their order: everything random but the camera's noise."""

    sequences: list[Sequence]  # one for each run, so repeats share one
    repeat: list[int]
    started: np.ndarray
    start_pose: np.ndarray  # (runs, 3): rear axle's middle and heading
    speed_factor: np.ndarray
    trim: np.ndarray


def nominal_path(vehicle: Vehicle, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Path of the rear axle of the ideal kinematic vehicle from the origin, to plan the starts."""
    step = 0.01
    times = np.arange(0, rows[-1, 0], step)
    row = np.searchsorted(rows[:, 0], times, side="right") - 1
    speed = vehicle.speed((rows[row, 1] - NEUTRAL_US) / vehicle.drive_span_us)
    angle = vehicle.angle((rows[row, 2] - NEUTRAL_US) / vehicle.front_span_us) + vehicle.trim
    heading = np.concatenate([[0], np.cumsum(speed * np.tan(angle) / vehicle.wheelbase * step)])[:-1]
    return np.cumsum(speed * np.cos(heading)) * step, np.cumsum(speed * np.sin(heading)) * step


def draw_session(vehicle: Vehicle, seed: int) -> Session:
    """Order, times, start poses and run-to-run variation of a campaign."""
    rng = np.random.default_rng([vehicle.number, seed, 0x5E55])
    blocks: list[list[tuple[Sequence, int]]] = []
    for sequence in Planner(vehicle).plan():
        runs = [(sequence, repeat) for repeat in range(sequence.repeats)]
        adjacent = 2 if rng.random() < 0.4 else 1  # some repeats follow directly
        blocks.append(runs[:adjacent])
        blocks.extend([run] for run in runs[adjacent:])
    order = [run for k in rng.permutation(len(blocks)) for run in blocks[k]]
    seen: dict[str, int] = {}
    repeats = [_count(seen, sequence.name) for sequence, _ in order]

    gaps = rng.lognormal(0.0, 0.5, len(order)) + (rng.random(len(order)) < 0.03) * rng.uniform(5, 15, len(order))
    waits = np.concatenate([[0.0], np.cumsum(gaps)[:-1]])
    longest = 20.0  # seconds that a run and the return to the next start take at least
    total = rng.uniform(1.5, 3.0) * 3600
    started = waits / waits[-1] * (total - longest * len(order)) + longest * np.arange(len(order))

    poses = []
    for sequence, _ in order:
        x, y = nominal_path(vehicle, sequence.us(vehicle))
        best = None
        for _ in range(200):  # a random heading with which the path fits on the floor, at a random place of those
            heading = rng.uniform(-np.pi, np.pi)
            px, py = x * np.cos(heading) - y * np.sin(heading), x * np.sin(heading) + y * np.cos(heading)
            low = np.array([-FLOOR_HALF_M - px.min(), -FLOOR_HALF_M - py.min()])
            high = np.array([FLOOR_HALF_M - px.max(), FLOOR_HALF_M - py.max()])
            excess = float(np.max(low - high))
            if best is None or excess < best[0]:
                best = (excess, heading, low, high)
            if excess < -0.2:
                break
        _, heading, low, high = best
        place = low + (high - low) * rng.uniform(0.0, 1.0, 2)
        poses.append((place[0], place[1], heading))
    return Session(
        [s for s, _ in order],
        repeats,
        np.round(started, 3),
        np.array(poses),
        1 + vehicle.speed_spread * rng.standard_normal(len(order)),
        vehicle.trim_spread * rng.standard_normal(len(order)),
    )


def _count(seen: dict[str, int], name: str) -> int:
    """How often `name` was counted before."""
    seen[name] = seen.get(name, -1) + 1
    return seen[name]


# ---------------------------------------------------------------------------------------------------------------------
# The plant


class Plant:
    """The cars of all runs at once. Arrays have one value for each run; those of wheels have a leading axis of 4."""

    def __init__(self, vehicle: Vehicle, p: Parameters, session: Session):
        self.vehicle, self.p, self.session = vehicle, p, session
        self.commands = [sequence.us(vehicle) for sequence in session.sequences]
        self.count = len(self.commands)
        last = max(rows[-1, 0] for rows in self.commands)
        self.t = np.arange(-PRE_ROLL_S, last + POST_ROLL_S, DT)
        self.drive, self.front = self._received()
        self._prepare_body()
        self._prepare_states()

    def _received(self) -> tuple[np.ndarray, np.ndarray]:
        """Commands from -1 to 1 as the vehicle receives them, on the integration grid (steps, runs)."""
        v, p = self.vehicle, self.p
        received = np.empty((2, len(self.t), self.count))
        delay = np.broadcast_to(p.delay, self.count)
        period = np.broadcast_to(p.radio_period, self.count)
        for run, rows in enumerate(self.commands):
            time = self.t.copy()
            if period[run] > 0:
                clock = self.session.started[run]
                time = np.floor((time + clock) / period[run]) * period[run] - clock
            row = np.searchsorted(rows[:, 0], time - delay[run] + 1e-6, side="right") - 1
            for channel, span in ((1, v.drive_span_us), (2, v.front_span_us)):
                values = (rows[:, channel] - NEUTRAL_US) / span
                received[channel - 1, :, run] = np.where(row >= 0, values[np.maximum(row, 0)], 0.0)
        return received[0], received[1]

    def _prepare_body(self) -> None:
        v, p = self.vehicle, self.p
        front, rear, half = v.wheelbase - v.cg_from_rear, -v.cg_from_rear, v.track / 2
        self.wheel_x = np.array([front, front, rear, rear])[:, None]
        self.wheel_y = np.array([half, -half, half, -half])[:, None]
        weight = v.mass * GRAVITY
        load = np.array([-rear, -rear, front, front])[:, None] / v.wheelbase / 2 * weight
        self.cornering = (p.tyre_coefficient or v.tyre_coefficient) * load  # in proportion to load: neutral steering
        self.front_grip = p.front_friction * float(load[FRONT].sum())
        self.share = np.array([0.0, 0.0, 0.5, 0.5] if v.driven == "rear" else [0.25] * 4)[:, None]
        self.inertia = np.diag([v.mass, v.mass, v.yaw_inertia]) / DT

    def _prepare_states(self) -> None:
        zeros = lambda: np.zeros(self.count)  # noqa: E731
        v, s = self.vehicle, self.session
        self.velocity = np.zeros((3, self.count))  # forward, left and yaw of the centre of gravity
        self.heading = s.start_pose[:, 2].copy()
        self.x = s.start_pose[:, 0] + v.cg_from_rear * np.cos(self.heading)
        self.y = s.start_pose[:, 1] + v.cg_from_rear * np.sin(self.heading)
        self.row = np.zeros(self.count, int)  # the received commands that are obeyed, with a radio shadow
        self.held, self.servo, self.wheel, self.crept, self.slipped = zeros(), zeros(), zeros(), zeros(), zeros()
        self.gyro, self.side = zeros(), zeros()
        self.motor, self.sagged, self.spent = zeros(), zeros(), zeros()
        self.last_direction, self.paused, self.rolling, self.waited = zeros(), zeros(), zeros(), zeros()

    def run(self) -> np.ndarray:
        """Integrate: poses (x, y, heading of the centre of gravity) for each step and run, shape (steps, 3, runs)."""
        poses = np.empty((len(self.t), 3, self.count))
        for step in range(len(self.t)):
            poses[step] = self.x, self.y, self.heading
            drive, front = self._obeyed(step)
            angle = self._steer(drive, front)
            self._turn_motor(drive, angle)
            self._move(angle)
        return poses

    def _obeyed(self, step: int) -> tuple[np.ndarray, np.ndarray]:
        """The commands that the vehicle obeys now, at its place."""
        if not self.p.shadow:
            return self.drive[step], self.front[step]
        x, y, radius, delay = self.p.shadow
        inside = np.hypot(self.x - x, self.y - y) < radius
        late = np.maximum(step - np.where(inside, round(delay / DT), 0), 0)
        self.row = np.maximum(self.row, late)  # nothing is obeyed twice
        runs = np.arange(self.count)
        return self.drive[self.row, runs], self.front[self.row, runs]

    def _steer(self, drive: np.ndarray, front: np.ndarray) -> np.ndarray:
        """Mean angle of the front wheels."""
        v, p = self.vehicle, self.p
        u = front + p.mixing * drive
        if p.deadband:
            self.held = np.where(np.abs(u - self.held) > p.deadband, u, self.held)
            u = self.held
        target = v.angle(u) * p.steering_gain
        change = (target - self.servo) * -np.expm1(-DT / (v.servo_tau + p.servo_tau))
        change = np.clip(change, -p.servo_rate * DT, p.servo_rate * DT)
        self.servo = self.servo + change
        if p.bec_loss:
            self.sagged = self.sagged * np.exp(-DT / p.bec_tau) + p.bec_loss * np.abs(change) / v.angle_curve[0]
        self.wheel = np.clip(self.wheel, self.servo - p.backlash / 2, self.servo + p.backlash / 2)
        angle = self.wheel
        if p.creep_part:
            self.crept = self.crept + (angle - self.crept) * DT / p.creep_tau
            angle = angle - p.creep_part * self.crept
        if p.saver_slip:
            beyond = np.abs(angle) > p.saver_limit
            self.slipped = np.where(beyond, -np.sign(angle) * p.saver_slip, self.slipped)
            angle = angle + self.slipped
        moving = np.clip(self.motor / CREEP_MPS, -1, 1)  # -1 backward, 1 forward
        angle = angle * np.where(moving < 0, 1 + (p.reverse_gain - 1) * -moving, 1.0)
        angle = angle + v.trim + self.session.trim + p.trim + p.trim_by_direction * moving
        if p.trim_by_heading:
            angle = angle - p.trim_by_heading * (self.heading - self.session.start_pose[:, 2])
        if p.gyro_gain:
            self.gyro = self.gyro + (self.velocity[2] - self.gyro) * DT / 0.03
            angle = angle - p.gyro_gain * self.gyro
        limit = np.radians(40.0)  # the linkage's stop
        return np.arctan(np.tan(np.clip(angle, -limit, limit)) / (1 + p.understeer * self.motor**2))

    def _turn_motor(self, drive: np.ndarray, angle: np.ndarray) -> None:
        """Advance the speed at which the motor turns the driven wheels."""
        v, p = self.vehicle, self.p
        target = v.speed(drive) * p.speed_factor * self.session.speed_factor
        target = target * (1 - np.minimum(p.corner_loss * np.abs(np.tan(angle)), 0.9))
        if p.polarisation:
            self.spent = self.spent + (np.abs(target) / v.speed_forward[0] - self.spent) * DT / p.polarisation_tau
            target = target * (1 - p.polarisation * self.spent)
        if p.bec_loss:
            target = target * (1 - np.minimum(self.sagged, 0.7))
        if p.patch:
            direction, middle, half_width, loss = p.patch
            place = self.x * np.cos(direction) + self.y * np.sin(direction)
            target = target * (1 - min(loss, 0.9) * (np.abs(place - middle) < half_width))
        if p.tether:
            target = self._tethered(target)
        if p.reverse_pause:
            target = self._pause_before_reversal(drive, target)
        if p.start_wait:
            target = self._stutter(drive, target)

        # a reversal is slowing down until the motor stands still
        slower = (target * self.motor < 0) | (np.abs(target) < np.abs(self.motor))
        tau = v.esc_tau + np.where(slower, p.tau_down, p.tau_up)
        change = (target - self.motor) * -np.expm1(-DT / tau)
        slowest = np.where(drive == 0, p.coast_limit, np.inf)
        limit = np.where(slower, slowest, p.launch_limit) * DT
        self.motor = self.motor + np.clip(change, -limit, limit)

    def _tethered(self, target: np.ndarray) -> np.ndarray:
        x, y, slack, per_metre = self.p.tether
        dx, dy = self.x - x, self.y - y
        distance = np.hypot(dx, dy) + 1e-9
        outward = (dx * np.cos(self.heading) + dy * np.sin(self.heading)) / distance
        pull = -per_metre * np.maximum(distance - slack, 0) * outward
        pulled = target + pull
        return np.where(target * pulled > 0, pulled, 0.0)  # the cable cannot drive the car backward

    def _pause_before_reversal(self, drive: np.ndarray, target: np.ndarray) -> np.ndarray:
        wanted = np.sign(drive)
        opposite = wanted * self.last_direction < 0
        self.paused = np.where(opposite, self.paused + DT, 0.0)
        done = (wanted != 0) & (~opposite | (self.paused >= self.p.reverse_pause))
        self.last_direction = np.where(done, wanted, self.last_direction)
        return np.where(wanted * self.last_direction < 0, 0.0, target)

    def _stutter(self, drive: np.ndarray, target: np.ndarray) -> np.ndarray:
        wanted = np.sign(drive)
        self.rolling = np.where(wanted == self.rolling, self.rolling, 0.0)
        self.waited = np.where((wanted != 0) & (self.rolling == 0), self.waited + DT, 0.0)
        started = self.waited >= self.p.start_wait / np.maximum(np.abs(drive), 0.05)
        self.rolling = np.where(started & (wanted != 0), wanted, self.rolling)
        return np.where(self.rolling == 0, 0.0, target)

    def _move(self, angle: np.ndarray) -> None:
        """One linear-implicit step of Newton's equations, and of the pose."""
        v, p = self.vehicle, self.p
        wheels = np.zeros((4, self.count))
        wheels[0], wheels[1] = v.wheel_angles(angle)
        if p.rear_play:
            self.side = self.side + (self.velocity[0] * self.velocity[2] - self.side) * DT / 0.03
            wheels[REAR] = p.rear_play * np.tanh(self.side / 0.15)
        cos, sin = np.cos(wheels), np.sin(wheels)
        along = np.stack([cos, sin, self.wheel_x * sin - self.wheel_y * cos])
        across = np.stack([-sin, cos, self.wheel_x * cos + self.wheel_y * sin])
        rolling = np.einsum("awr,ar->wr", along, self.velocity)
        stiffness = self.cornering / np.maximum(np.abs(rolling), CREEP_MPS)  # N per m/s of sideways speed
        if np.isfinite(p.front_friction):
            sideways = np.einsum("awr,ar->wr", across[:, FRONT], self.velocity)
            ratio = np.abs((stiffness[FRONT] * sideways).sum(axis=0)) / self.front_grip + 1e-9
            stiffness[FRONT] *= np.tanh(ratio) / ratio
        driven = (self.share * along).sum(axis=1)  # speed of the differentials' inputs = driven · velocity

        matrix = np.einsum("awr,bwr->rab", across * stiffness, across)
        matrix += v.drive_stiffness * driven.T[:, :, None] * driven.T[:, None, :]
        matrix += self.inertia
        ux, uy, yaw = self.velocity
        momentum = self.inertia.diagonal()[:, None] * self.velocity
        turning = v.mass * np.stack([yaw * uy, -yaw * ux, np.zeros(self.count)])
        force = momentum + turning + v.drive_stiffness * driven * self.motor
        new = np.linalg.solve(matrix, force.T[:, :, None])[:, :, 0].T

        mean = 0.5 * (self.velocity + new)
        middle = self.heading + 0.5 * DT * mean[2]
        cos, sin = np.cos(middle), np.sin(middle)
        moving = np.tanh(np.abs(mean[0]) / CREEP_MPS)
        drift_x, drift_y = p.drift
        if p.dip:
            x, y, per_metre = p.dip
            drift_x, drift_y = drift_x + per_metre * (x - self.x), drift_y + per_metre * (y - self.y)
        self.x = self.x + DT * (mean[0] * cos - mean[1] * sin + moving * drift_x)
        self.y = self.y + DT * (mean[0] * sin + mean[1] * cos + moving * drift_y)
        self.heading = self.heading + DT * mean[2]
        self.velocity = new


# ---------------------------------------------------------------------------------------------------------------------
# The camera


class Camera:
    """Turns the poses of the plant into frames of the motion capture."""

    def __init__(self, vehicle: Vehicle, p: Parameters, plant: Plant, poses: np.ndarray):
        self.vehicle, self.p, self.plant, self.poses = vehicle, p, plant, poses

    def seen(self, run: int, t: np.ndarray) -> np.ndarray:
        """Tracked pose (x, y, heading) at times t without noise, shape (3, frames)."""
        v, p = self.vehicle, self.p
        late = t - self._of(p.latency, run)
        x, y, heading = (np.interp(late, self.plant.t, self.poses[:, k, run]) for k in range(3))
        forward, left = v.marker_from_rear - v.cg_from_rear + p.offset[0], np.full_like(x, p.offset[1])
        turn = self._of(p.misalignment, run)
        if p.occlusion:
            direction, middle, half_width, shift_forward, shift_left, shift_turn = p.occlusion
            hidden = np.abs(x * np.cos(direction) + y * np.sin(direction) - middle) < half_width
            forward, left = forward + shift_forward * hidden, left + shift_left * hidden
            turn = turn + shift_turn * hidden
        x, y = (
            x + forward * np.cos(heading) - left * np.sin(heading),
            y + forward * np.sin(heading) + left * np.cos(heading),
        )
        if p.distortion:
            cx, cy, k = p.distortion
            stretch = 1 + k * ((x - cx) ** 2 + (y - cy) ** 2)
            x, y = cx + (x - cx) * stretch, cy + (y - cy) * stretch
        return np.stack([(x + p.skew * y) * p.scale, y * p.scale, heading + turn])

    @staticmethod
    def _of(value: float | np.ndarray, run: int) -> float:
        return float(value[run]) if np.ndim(value) else float(value)

    def frames(self, run: int, run_id: str, rng: np.random.Generator) -> pd.DataFrame:
        """The frames of a run: with noise, and with half a percent of them missing or untracked."""
        v = self.vehicle
        rows = self.plant.commands[run]
        first_motion = rows[np.flatnonzero(rows[:, 1] != NEUTRAL_US)[0], 0]
        begin, end = first_motion - rng.uniform(0.45, 0.55), rows[-1, 0] + rng.uniform(0.95, 1.1)
        begin = min(begin, -0.3)  # also if the steering moves before the car
        t = begin + np.arange(int((end - begin) * v.rate_hz)) / v.rate_hz
        x, y, heading = self.seen(run, t)
        x = x + v.position_noise * rng.standard_normal(len(t))
        y = y + v.position_noise * rng.standard_normal(len(t))
        heading = heading + v.heading_noise * rng.standard_normal(len(t))
        heading = (heading + np.pi) % (2 * np.pi) - np.pi
        lost = rng.random(len(t)) < 0.005
        untracked = lost & (rng.random(len(t)) < 0.4)
        frames = pd.DataFrame(
            {
                "run_id": run_id,
                "t_s": t,
                "x_m": x,
                "y_m": y,
                "heading_rad": heading,
                "tracked": ~untracked,
                "frame": np.arange(len(t)),
            }
        )
        frames.loc[untracked, ["x_m", "y_m", "heading_rad"]] = np.nan
        return frames[~lost | untracked]


# ---------------------------------------------------------------------------------------------------------------------
# Campaigns


def simulate(
    vehicle: Vehicle, names: list[str], scale: float, seed: int
) -> tuple[Session, Plant, Camera, dict[str, dict[str, float]]]:
    """Drive a campaign. The same vehicle and seed give the same session, whatever the causes."""
    session = draw_session(vehicle, seed)
    hours = session.started / 3600
    progress = SimpleNamespace(hours=hours, part=session.started / session.started[-1])
    p = Parameters()
    drawn = {}
    for name in sorted(names):
        drawn[name] = CAUSES[name].draw(vehicle, scale)
        CAUSES[name].apply(p, SimpleNamespace(**drawn[name]), progress)
    plant = Plant(vehicle, p, session)
    return session, plant, Camera(vehicle, p, plant, plant.run()), drawn


def header(vehicle: Vehicle) -> str:
    """The text of campaign.toml."""
    rear = vehicle.driven == "rear"
    lines = [
        f"schema = {2 if rear else 1}",
        f'name = "front-steered-{vehicle.number}"',
        "",
        "[vehicle]",
        f'name = "front-steered-{vehicle.number}"',
        f"front_axle_m = {vehicle.stated_front:.5f}",
        f"rear_axle_m = {vehicle.stated_rear:.5f}",
        'command_unit = "us"',
        f"neutral = {NEUTRAL_US}",
    ]
    lines += ['driven = "rear"'] if rear else []
    return "\n".join([*lines, "", "[mocap]", f"rate_hz = {vehicle.rate_hz}", ""])


def tables(vehicle: Vehicle, session: Session, camera: Camera, seed: int) -> dict[str, pd.DataFrame]:
    """The tables runs, commands and poses."""
    rng = np.random.default_rng([vehicle.number, seed, 0xF0CA1])
    runs, commands, poses = [], [], []
    for run, (sequence, repeat) in enumerate(zip(session.sequences, session.repeat, strict=True)):
        run_id = f"{sequence.name}-r{repeat + 1:02d}"
        rows = camera.plant.commands[run]
        runs.append(
            {
                "run_id": run_id,
                "experiment": sequence.experiment,
                "trajectory": sequence.name,
                "condition": "",
                "repeat": repeat,
                "target_x_m": np.nan,
                "target_y_m": np.nan,
                "target_heading_rad": np.nan,
                "started_s": session.started[run],
                "status": "ok",
                "firmware": "",
            }
        )
        commands.append(
            pd.DataFrame(
                {"run_id": run_id, "t_s": rows[:, 0], "drive": rows[:, 1], "front": rows[:, 2], "rear": NEUTRAL_US}
            )
        )
        poses.append(camera.frames(run, run_id, rng))
    return {
        "runs": pd.DataFrame(runs),
        "commands": pd.concat(commands, ignore_index=True),
        "poses": pd.concat(poses, ignore_index=True),
    }


def write(directory: Path, number: int, names: list[str], scale: float, seed: int) -> None:
    """Write a campaign and, beside it, its truth."""
    truth_file = directory.parent / (directory.name + ".truth.json")
    if directory.exists():
        raise SystemExit(f"{directory} exists already")
    vehicle = Vehicle.draw(number)
    session, _, camera, drawn = simulate(vehicle, names, scale, seed)
    truth = {
        "simulator": "front_steered",
        "vehicle": number,
        "seed": seed,
        "scale": scale,
        "causes": {
            name: {
                "kind": CAUSES[name].kind,
                "text": CAUSES[name].text,
                "sizes": sizes,
                "units": {size: CAUSES[name].sizes[size].unit for size in sizes},
            }
            for name, sizes in drawn.items()
        },
        "true_vehicle": vars(vehicle),
    }
    directory.parent.mkdir(parents=True, exist_ok=True)
    partial = directory.parent / f".tmp-{directory.name}"
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir()
    for name, table in tables(vehicle, session, camera, seed).items():
        table.to_parquet(partial / f"{name}.parquet", index=False)
    (partial / "campaign.toml").write_text(header(vehicle), encoding="utf-8")
    truth_file.write_text(json.dumps(truth, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    partial.rename(directory)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Simulate a front-steered model car under motion capture.")
    actions = parser.add_subparsers(dest="action", required=True)
    actions.add_parser("list", help="print the causes and their kinds as JSON")
    writer = actions.add_parser("write", help="write a campaign directory")
    writer.add_argument("directory", type=Path, metavar="DIR")
    writer.add_argument("--vehicle", type=int, required=True)
    writer.add_argument("--causes", default="", help="names, separated by commas")
    writer.add_argument("--scale", type=float, default=1.0)
    writer.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    if options.action == "list":
        json.dump({name: entry.kind for name, entry in CAUSES.items()}, sys.stdout, indent=1)
        print()
        return
    names = sorted({name.strip() for name in options.causes.split(",") if name.strip()})
    unknown = [name for name in names if name not in CAUSES]
    if unknown:
        parser.error(f"unknown causes: {', '.join(unknown)}")
    if options.vehicle < 0 or options.seed < 0 or not options.scale > 0:
        parser.error("--vehicle and --seed must not be negative, --scale must be positive")
    write(options.directory, options.vehicle, names, options.scale, options.seed)


if __name__ == "__main__":
    main()
