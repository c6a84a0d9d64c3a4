"""A model AGV with two steered axles under motion capture, modelled by forces.

    python rigid_body.py list
    python rigid_body.py write DIRECTORY --vehicle N [--causes a,b] [--scale S] [--seed K]

The body is rigid (mass, yaw inertia) on four wheels. Each tyre transmits a force in proportion to its slip, that is
to the difference between the velocity at which the wheel would roll and the velocity of the body above it, divided by
the rolling speed; the stiffness is such that the vehicle practically rolls. The velocity is integrated by implicit
Euler steps of 2 ms for all runs at once. Electronic differentials give each wheel the speed that rolling without slip
demands; the mean of the speeds of the two axles (at their centres) is the speed that drive commands.

Frames: body x ahead, y left, heading and axle angles counter-clockwise; a command above neutral steers left.
Each cause is a class with hooks that the simulation calls.
"""

import argparse
import json
import sys
import zlib
from pathlib import Path

import numpy as np
import pandas as pd

DT = 0.002  # integration step [s]
LEAD = 0.8  # simulated before the first command [s]
TAIL = 1.4  # and after the last
NEUTRAL = 1500
DEG = np.pi / 180
GRAVITY = 9.81
CREEP = 0.02  # rolling speed below which a tyre acts as a damper [m/s]
ROOM = 2.0  # half the floor's side [m]


def generator(*keys):
    return np.random.default_rng([zlib.crc32(k.encode()) if isinstance(k, str) else int(k) for k in keys])


def rotate(angle, x, y):
    c, s = np.cos(angle), np.sin(angle)
    return c * x - s * y, s * x + c * y


# ------------------------------------------------------------------------------------------------------- vehicle


class Vehicle:
    """What vehicle number N is: geometry, inertia, static maps, noise."""

    def __init__(self, number):
        r = generator(number, "vehicle")
        self.number = number
        self.wheelbase = r.uniform(0.28, 0.32)
        self.track = r.uniform(0.17, 0.22)
        self.mass = r.uniform(2.5, 4.0)
        self.inertia = self.mass * r.uniform(0.010, 0.016)
        centre = r.uniform(0.44, 0.56)  # centre of mass, share of the wheelbase behind the front axle
        self.front, self.rear = centre * self.wheelbase, (1 - centre) * self.wheelbase
        self.marker_front = r.uniform(0.40, 0.62) * self.wheelbase  # marker body to front axle
        self.marker_rear = self.wheelbase - self.marker_front
        self.marker_x = self.front - self.marker_front  # from the centre of mass
        error = r.uniform(0.0005, 0.0018, 2) * r.choice([-1, 1], 2)
        self.stated_front = round(float(self.marker_front + error[0]), 4)
        self.stated_rear = round(float(self.marker_rear + error[1]), 4)
        self.stiffness = r.uniform(1300, 1800)  # slip stiffness of a wheel [N]
        self.servo_tau = r.uniform(0.0012, 0.0025)
        self.drive_tau = r.uniform(0.0012, 0.0025)
        # static maps
        self.span = r.uniform(36, 40.5, 2) * DEG
        self.square = r.uniform(-0.05, 0.05, 2)
        self.cube = r.uniform(-0.12, 0.08, 2)
        self.offset = r.uniform(0.2, 1.0, 2) * r.choice([-1, 1], 2) * DEG
        self.stop = r.uniform(35, 37.5, (2, 2)) * DEG  # axle, side
        self.top = r.uniform(0.29, 0.41) * np.array([1.0, r.uniform(0.86, 0.97)])  # forward, backward [m/s]
        self.dead = r.uniform(22, 48, 2)
        self.bend = r.uniform(1.1, 1.8, 2)
        # noise
        self.angle_sd = r.uniform(0.05, 0.07) * DEG
        self.speed_sd = r.uniform(0.0022, 0.0033)
        self.position_sd = r.uniform(0.0002, 0.0005)
        self.heading_sd = r.uniform(0.03, 0.06) * DEG
        self.lost = r.uniform(0.002, 0.006)
        self.rate = float(r.choice([60, 100]))

    def axle_angles(self, front, rear):
        """Static angles (…, 2) of the axles at commands in µs."""
        u = (np.stack([front, rear], axis=-1) - NEUTRAL) / 500
        angle = self.span * (u + self.square * u**2 + self.cube * u**3) / (1 + self.cube) + self.offset
        return np.clip(angle, -self.stop[:, 0], self.stop[:, 1])

    def speed(self, drive):
        """Static speed of the wheels at commands in µs."""
        d = np.asarray(drive, float) - NEUTRAL
        side = np.where(d < 0, 1, 0)
        x = np.clip((np.abs(d) - self.dead[side]) / (470 - self.dead[side]), 0, 1)  # saturates at 470 µs
        return np.sign(d) * self.top[side] * np.tanh(self.bend[side] * x) / np.tanh(self.bend[side])


# ------------------------------------------------------------------------------------------------------ the plan


def plan_of_runs(vehicle):
    """Commands of the vehicle's campaign: list of (experiment, name, repeats, rows (t, drive, front, rear))."""
    r = generator(vehicle.number, "plan")
    plan = []
    n = NEUTRAL

    def tick(t):
        return round(t / 0.01) * 0.01

    def add(experiment, name, repeats, pieces):
        """pieces: (duration, drive, front, rear) from the start; neutral drive before and after."""
        _, _, front, rear = pieces[0]
        wait = tick(r.uniform(0.2, 0.7))
        ahead = r.random() < 0.6  # steering set before the start, otherwise with it
        rows = [(0.0, n, front, rear) if ahead else (0.0, n, n, n)]
        t = wait
        for duration, *command in pieces:
            rows.append((round(t, 2), *command))
            t = tick(t + duration)
        rows.append((round(t, 2), n, *pieces[-1][2:]))
        plan.append((experiment, name, repeats, [(float(a), *map(int, b)) for a, *b in rows]))

    def jitter(value, width=15):
        return int(round(value + r.uniform(-width, width)))

    def limit(value):
        return int(np.clip(value, 1000, 2000))

    def seconds(drive, distance=1.6, low=2.6, high=6.2):
        v = abs(float(vehicle.speed(drive)))
        return float(np.clip(distance / max(v, 0.05) * r.uniform(0.85, 1.1), low, high))

    fast, middle, slow = n + jitter(440), n + jitter(280), n + jitter(170)
    back_fast, back = n - jitter(430), n - jitter(270)

    for sign in (1, -1):
        for i, level in enumerate((90, 150, 230, 320, 410, 500)):
            drive = limit(n + sign * jitter(level))
            add("drive", f"straight-{'f' if sign > 0 else 'b'}{i}", 2, [(seconds(drive, 1.7), drive, n, n)])

    def turn(experiment, label, commands, drive, repeats):
        for i, (front, rear) in enumerate(commands):
            pieces = [(seconds(drive, r.uniform(1.2, 1.7)), drive, limit(front), limit(rear))]
            add(experiment, f"{label}-{i}", repeats, pieces)

    def levels(*values):
        return [n + s * jitter(v) for v in values for s in (1, -1)]

    turn("steering_front", "front-middle", [(a, n) for a in levels(110, 230, 350, 480)], middle, 2)
    turn("steering_rear", "rear-middle", [(n, a) for a in levels(150, 310, 470)], middle, 2)
    turn("steering_opposite", "opposite-middle", [(a, 2 * n - a) for a in levels(120, 260, 420)], middle, 2)
    turn("steering_opposite", "opposite-fast", [(a, 2 * n - a) for a in levels(180, 380)], fast, 2)
    turn("steering_front", "front-fast", [(a, n) for a in levels(220, 430)], fast, 2)
    turn("steering_front", "front-slow", [(a, n) for a in levels(350)], slow, 2)
    turn("steering_front", "front-back", [(a, n) for a in levels(180, 400)], back, 2)
    turn("steering_rear", "rear-back", [(n, a) for a in levels(300)], back_fast, 2)
    turn("steering_opposite", "opposite-back", [(a, 2 * n - a) for a in levels(250)], back, 2)
    turn("crab", "crab-middle", [(a, a) for a in levels(200, 420)], middle, 2)
    turn("crab", "crab-fast", [(a, a) for a in levels(320)], fast, 2)

    for i in range(7):  # combined
        front, rear = r.integers(-470, 471, 2)
        drive = n + r.choice([1, 1, -1]) * r.integers(150, 480)
        pieces = [(seconds(drive, 1.5), drive, n + front, n + rear)]
        add("combined", f"combined-{i}", 2 + (i == 0) * 2, pieces)

    def sides(drive, parts, duration, front, rear):
        return [(duration, drive, n + (-1) ** i * front, n + (-1) ** i * rear) for i in range(parts)]

    a, b, c, d = (jitter(v, 40) for v in (330, 220, 400, 300))
    add("step", "slalom-fast", 2, sides(fast, 5, 0.8, a, 0))
    add("step", "slalom-middle", 2, sides(middle, 4, 1.1, -b, b))
    add("step", "slalom-back", 2, sides(back, 4, 1.0, d, 0))
    add("step", "s-curve-front", 2, sides(middle, 2, 2.4, c, 0))
    add("step", "s-curve-opposite", 3, sides(fast, 2, 1.9, -d, d))
    add("step", "s-curve-crab", 2, sides(middle, 2, 2.2, d, d))
    add("step", "step-front-left", 2, [(1.6, middle, n, n), (2.2, middle, n + c, n)])
    add("step", "step-front-right", 2, [(1.3, fast, n, n), (1.2, fast, n - a, n), (1.6, fast, n, n)])
    add("step", "step-rear-left", 2, [(1.5, middle, n, n), (2.3, middle, n, n + a)])
    add("step", "step-rear-right", 2, [(1.5, fast, n, n), (2.0, fast, n, n - c), (1.0, fast, n, n)])
    add("step", "step-both", 2, [(1.2, middle, n + b, n), (1.5, middle, n + b, n - b), (1.8, middle, n - b, n - b)])

    add("step", "speed-up", 2, [(2.0, slow, n, n), (2.0, fast, n, n), (1.2, middle, n, n)])
    add("step", "speed-up-turn", 2, [(2.2, slow, n + d, n), (2.4, fast, n + d, n)])
    add("step", "speed-down-turn", 2, [(1.8, fast, n - b, n + b), (2.5, slow, n - b, n + b)])
    add("step", "stop-straight", 2, [(1.8, fast, n, n), (0.8, n, n, n), (1.8, middle, n, n)])
    add("step", "stop-turn", 2, [(1.6, middle, n + a, n), (0.7, n, n + a, n), (2.0, middle, n - a, n)])
    add("step", "stops", 2, [(0.8, fast, n, n), (0.5, n, n, n)] * 3 + [(0.8, fast, n, n)])
    add("step", "reverse-straight", 3, [(2.2, fast, n, n), (0.6, n, n, n), (2.0, back_fast, n, n)])
    add("step", "reverse-direct", 2, [(2.0, middle, n, n), (1.8, back, n, n), (1.0, middle, n, n)])
    add("step", "reverse-turn", 2, [(2.0, middle, n + c, n), (0.5, n, n - c, n), (2.2, back, n - c, n)])
    add("step", "reverse-opposite", 2, [(1.8, back, n - b, n + b), (2.2, middle, n + b, n - b)])
    return plan


class Campaign:
    """The runs in the order in which they were driven, their times and random variation."""

    def __init__(self, vehicle, seed):
        self.vehicle, self.seed = vehicle, seed
        r = generator(vehicle.number, seed, "campaign")
        order = []
        for experiment, name, repeats, rows in plan_of_runs(vehicle):
            for repeat in range(repeats):
                order.append(((repeat + r.random()) / repeats, experiment, name, repeat, rows))
        order.sort(key=lambda item: item[0])
        self.runs = [item[1:] for item in order]
        self.n = len(self.runs)
        self.last = np.array([rows[-1][0] for *_, rows in self.runs])
        pause = r.gamma(9, 1.5, self.n) + r.uniform(0, 3, self.n)
        pause[r.random(self.n) < 0.03] += 60.0  # somebody tidies up
        pause *= (3600 * r.uniform(0.94, 1.06) - self.last.sum()) / pause.sum()
        self.started = np.round(20 + np.cumsum(pause) + np.concatenate([[0], np.cumsum(self.last)[:-1]]), 2)
        self.length = float(self.started[-1] + self.last[-1])
        self.angle_error = r.normal(0, vehicle.angle_sd, (self.n, 2))
        self.speed_factor = 1 + r.normal(0, vehicle.speed_sd, self.n)
        self.t = np.arange(-round(LEAD / DT), round((self.last.max() + TAIL) / DT) + 1) * DT
        commands = np.full((self.n, len(self.t), 3), float(NEUTRAL))
        for i, (*_, rows) in enumerate(self.runs):
            for t, *values in rows:
                commands[i, np.searchsorted(self.t, t - DT / 4) :] = values
        self.commands = commands
        self._place(r)

    def static(self, shift=0.0):
        """Angles (n, steps, 2) and speeds (n, steps) that the commands ask for, obeyed `shift` s late."""
        c = self.commands
        late = round(shift / DT)
        if late:
            c = np.concatenate([np.full_like(c[:, :late], NEUTRAL), c[:, :-late]], axis=1)
        angles = self.vehicle.axle_angles(c[..., 1], c[..., 2]) + self.angle_error[:, None]
        return angles, self.vehicle.speed(c[..., 0]) * self.speed_factor[:, None]

    def _place(self, r):
        """Random start poses from which the kinematic path stays on the floor."""
        x, y, h = kinematic_path(self.vehicle, *self.static(), np.zeros((3, self.n)))
        self.start = np.zeros((3, self.n))
        for i in range(self.n):
            best = None
            for _ in range(40):
                turn = r.uniform(-np.pi, np.pi)
                px, py = rotate(turn, x[::20, i], y[::20, i])
                low = np.array([-px.min(), -py.min()]) - (ROOM - 0.25)
                high = (ROOM - 0.25) - np.array([px.max(), py.max()])
                if np.all(high > low):
                    best = turn, *r.uniform(low, high)
                    break
                best = best or (turn, *((low + high) / 2))
            self.start[:, i] = best[1], best[2], best[0]


def kinematic_path(vehicle, angles, speeds, start):
    """Marker's path (steps, n) of a two-axle bicycle that rolls without slip."""
    tan, cos = np.tan(angles), np.cos(angles)
    vx = 2 * speeds / (1 / cos).sum(axis=-1)
    rate = vx * (tan[..., 0] - tan[..., 1]) / vehicle.wheelbase
    vy = vx * (vehicle.marker_rear * tan[..., 0] + vehicle.marker_front * tan[..., 1]) / vehicle.wheelbase
    h = start[2] + np.cumsum(rate.T * DT, axis=0) - rate.T * DT
    dx, dy = rotate(h + rate.T * DT / 2, vx.T, vy.T)
    x = start[0] + (np.cumsum(dx, axis=0) - dx) * DT
    y = start[1] + (np.cumsum(dy, axis=0) - dy) * DT
    return x, y, h


# ---------------------------------------------------------------------------------------------------- simulation


class Simulation:
    """Integrates all runs of a campaign. Causes read and change its attributes in their hooks.

    In each step: `command` (angle_target, speed_target) -> servos -> `linkage` (angle) and drive -> `wheels`
    (speed, factor of each wheel) -> `forces` (tyres, force and moment on the body, moving floor) -> velocity, pose.
    Wheels: 0 front left, 1 front right, 2 rear left, 3 rear right.
    """

    def __init__(self, campaign, causes):
        self.campaign, self.vehicle, self.causes = campaign, campaign.vehicle, causes
        v, n = self.vehicle, campaign.n
        self.n, self.rng = n, generator(v.number, campaign.seed, "states")
        self.wheel_x = np.array([v.front, v.front, -v.rear, -v.rear])
        self.wheel_y = np.array([1, -1, 1, -1]) * v.track / 2
        # actuators
        self.delay = 0.0
        self.servo_tau = v.servo_tau
        self.servo_rate = [np.inf, np.inf]  # towards the right, towards the left [rad/s]
        self.drive_tau = [v.drive_tau, v.drive_tau]  # when speeding up, when slowing down
        self.servo_model = self.drive_model = None  # replaced by causes with a controller of their own
        # tyres and body
        self.stiffness = np.full(4, v.stiffness)
        self.lateral_limit = np.inf  # greatest lateral force of a wheel [N]
        self.motor_slope = 0.0  # speed lost per drive force on a wheel [m/s/N]
        # states
        self.velocity = np.zeros((n, 3))  # centre of mass, body frame: x, y, yaw rate
        self.x, self.y = self._centre(*campaign.start)
        self.h = campaign.start[2].copy()
        self.servo = None
        self.drive = np.zeros(n)
        self.direction = np.ones(n)
        self.speed = np.zeros(n)
        for cause in causes:
            cause.prepare(self)

    def _centre(self, x, y, h):
        return x - self.vehicle.marker_x * np.cos(h), y - self.vehicle.marker_x * np.sin(h)

    def hook(self, name):
        for cause in self.causes:
            getattr(cause, name)(self)

    def run(self):
        """True marker poses x, y, h, each (steps, n)."""
        angles, speeds = self.campaign.static(self.delay)
        steps = len(self.campaign.t)
        out = np.empty((3, steps, self.n))
        self.servo = angles[:, 0].copy()
        self.angle = self.servo.copy()
        for k, t in enumerate(self.campaign.t):
            out[:, k] = self.x, self.y, self.h
            self.t, self.k = t, k
            self.clock = self.campaign.started + t  # time of the campaign
            self.angle_target, self.speed_target = angles[:, k].copy(), speeds[:, k].copy()
            self.hook("command")
            self._servos()
            self._drive()
            self.angle = self.servo.copy()
            self.speed = self.drive.copy()
            self.direction = np.where(np.abs(self.speed) > 0.004, np.sign(self.speed), self.direction)
            self.hook("linkage")
            self.factor = np.ones((self.n, 4))
            self.hook("wheels")
            self.force = np.zeros((self.n, 2))  # floor frame
            self.moment = np.zeros(self.n)
            self.floor = np.zeros((self.n, 2))  # velocity of the floor under the wheels, floor frame
            self.hook("forces")
            self._body()
        out[0] += self.vehicle.marker_x * np.cos(out[2])
        out[1] += self.vehicle.marker_x * np.sin(out[2])
        return out

    def _servos(self):
        if self.servo_model is not None:
            self.servo_model(self)
            return
        move = (self.angle_target - self.servo) * -np.expm1(-DT / self.servo_tau)
        self.servo += np.clip(move, -self.servo_rate[0] * DT, self.servo_rate[1] * DT)

    def _drive(self):
        if self.drive_model is not None:
            self.drive_model(self)
            return
        slows = (np.abs(self.speed_target) < np.abs(self.drive)) | (self.speed_target * self.drive < 0)
        up, down = (-np.expm1(-DT / tau) for tau in self.drive_tau)
        self.drive += (self.speed_target - self.drive) * np.where(slows, down, up)

    def _body(self):
        v = self.vehicle
        tan = np.tan(self.angle)
        # rolling at unit speed
        vx = 2 / np.sqrt(1 + tan**2).sum(axis=1)
        rate = vx * (tan[:, 0] - tan[:, 1]) / v.wheelbase
        vy = vx * (v.rear * tan[:, 0] + v.front * tan[:, 1]) / v.wheelbase
        ux = vx[:, None] - rate[:, None] * self.wheel_y
        uy = vy[:, None] + rate[:, None] * self.wheel_x
        norm = np.hypot(ux, uy)
        ex, ey = ux / norm, uy / norm
        roll = self.speed[:, None] * self.factor
        fx, fy = rotate(-self.h, self.floor[:, 0], self.floor[:, 1])
        wx, wy = ux * roll + fx[:, None], uy * roll + fy[:, None]  # the contact's velocity without slip
        # force of a tyre: damping times the slip's velocity, along and across the wheel
        damping = self.stiffness / np.maximum(np.abs(self.speed), CREEP)[:, None]
        vel = self.velocity
        slip_x = wx - (vel[:, :1] - vel[:, 2:] * self.wheel_y)
        slip_y = wy - (vel[:, 1:2] + vel[:, 2:] * self.wheel_x)
        across = damping
        if np.isfinite(self.lateral_limit):
            lateral = np.abs(ex * slip_y - ey * slip_x)
            across = damping / (1 + damping * lateral / self.lateral_limit)
        along = damping
        if self.motor_slope:
            moving = (np.abs(self.speed) > 0.01)[:, None]  # brakes hold at standstill
            along = np.where(moving, 1 / (1 / damping + self.motor_slope), damping)
        dxx = along * ex**2 + across * ey**2
        dyy = along * ey**2 + across * ex**2
        dxy = (along - across) * ex * ey
        px, py = self.wheel_x, self.wheel_y
        # forces on the body are g - a @ velocity
        gx, gy = dxx * wx + dxy * wy, dxy * wx + dyy * wy
        jx, jy = dxy * px - dxx * py, dyy * px - dxy * py
        a = np.empty((self.n, 3, 3))
        a[:, 0, 0], a[:, 1, 1] = dxx.sum(axis=1), dyy.sum(axis=1)
        a[:, 0, 1] = a[:, 1, 0] = dxy.sum(axis=1)
        a[:, 0, 2] = a[:, 2, 0] = jx.sum(axis=1)
        a[:, 1, 2] = a[:, 2, 1] = jy.sum(axis=1)
        a[:, 2, 2] = (jy * px - jx * py).sum(axis=1)
        qx, qy = rotate(-self.h, self.force[:, 0], self.force[:, 1])
        g = np.stack([gx.sum(axis=1) + qx, gy.sum(axis=1) + qy, (gy * px - gx * py).sum(axis=1) + self.moment], axis=1)
        inertia = np.array([v.mass, v.mass, v.inertia]) / DT
        a[:, [0, 1, 2], [0, 1, 2]] += inertia
        a[:, 0, 1] -= v.mass * vel[:, 2]  # rotating frame
        a[:, 1, 0] += v.mass * vel[:, 2]
        new = np.linalg.solve(a, (g + inertia * vel)[..., None])[..., 0]
        mean = (new + vel) / 2
        dx, dy = rotate(self.h + mean[:, 2] * DT / 2, mean[:, 0], mean[:, 1])
        self.x = self.x + dx * DT
        self.y = self.y + dy * DT
        self.h = self.h + mean[:, 2] * DT
        self.velocity = new


# -------------------------------------------------------------------------------------------------------- causes


class R:
    """A range of a parameter: uniform, times scale**power, with a random sign where signed."""

    def __init__(self, low, high, power=1, signed=False):
        self.low, self.high, self.power, self.signed = low, high, power, signed

    def draw(self, rng, scale):
        value = rng.uniform(self.low, self.high) * scale**self.power
        return float(value * rng.choice([-1, 1])) if self.signed else float(value)


DIRECTION = R(-np.pi, np.pi, 0)
CAUSES = {}


class Cause:
    kind = "inside"
    ranges = {}

    def __init__(self, vehicle, scale, length):
        rng = generator(vehicle.number, type(self).name)
        self.parameters = {name: span.draw(rng, scale) for name, span in self.ranges.items()}
        self.__dict__.update(self.parameters)
        self.vehicle, self.length = vehicle, length

    def prepare(self, s): ...
    def command(self, s): ...
    def linkage(self, s): ...
    def wheels(self, s): ...
    def forces(self, s): ...

    def pose(self, x, y, h, started):
        """What the camera makes of the true pose."""
        return x, y, h

    def stamp(self, started):
        """What the camera adds to its time stamps [s]."""
        return 0.0

    def __init_subclass__(cls):
        text = cls.__name__
        cls.name = "".join("_" + c.lower() if c.isupper() else c for c in text).lstrip("_")
        if not text.startswith("Base"):
            CAUSES[cls.name] = cls


def moving(s, full=0.03):
    """0 at rest to 1 in motion."""
    return np.minimum(np.abs(s.speed) / full, 1)


def steer_outward(s, gradient):
    """Understeer: the front axle runs outward and the rear axle inward in proportion to lateral acceleration."""
    shift = gradient * s.vehicle.wheelbase * s.velocity[:, 0] * s.velocity[:, 2] / 2
    s.angle = np.arctan(np.tan(s.angle) + np.stack([-shift, shift], axis=1))


# -- inside


class ActuationDelay(Cause):
    ranges = {"delay_s": R(0.05, 0.15)}

    def prepare(self, s):
        s.delay += self.delay_s


class SteeringLag(Cause):
    ranges = {"tau_s": R(0.1, 0.3)}

    def prepare(self, s):
        s.servo_tau = self.tau_s


class SteeringRateLimit(Cause):
    ranges = {"rate_rad_s": R(0.6, 1.5, -1)}

    def prepare(self, s):
        s.servo_rate = [self.rate_rad_s] * 2


class SteeringBacklash(Cause):
    """The wheels follow the servo's horn with play; aligning torque brings them near the middle between runs."""

    ranges = {"front_play_deg": R(2, 5), "rear_play_deg": R(2, 5)}

    def prepare(self, s):
        self.half = np.array([self.front_play_deg, self.rear_play_deg]) * DEG / 2
        self.hang = s.rng.uniform(-0.2, 0.2, (s.n, 2)) * self.half
        self.wheel = None

    def linkage(self, s):
        if self.wheel is None:
            self.wheel = s.angle + self.hang
        self.wheel = np.clip(self.wheel, s.angle - self.half, s.angle + self.half)
        s.angle = self.wheel.copy()


class AxleCoupling(Cause):
    ranges = {"share": R(0.05, 0.12)}

    def linkage(self, s):
        s.angle = s.angle + self.share * s.angle[:, ::-1]


class ReverseSteeringGain(Cause):
    ranges = {"gain": R(0.08, 0.20, signed=True)}

    def linkage(self, s):
        s.angle = s.angle * np.where(s.direction < 0, 1 + self.gain, 1)[:, None]


class SpeedLag(Cause):
    ranges = {"up_tau_s": R(0.15, 0.40), "down_tau_s": R(0.12, 0.35)}

    def prepare(self, s):
        s.drive_tau = [self.up_tau_s, self.down_tau_s]


class CorneringSpeedLoss(Cause):
    """Scrubbing of turned wheels loads the motor, whose speed falls linearly with its load."""

    ranges = {"loss_per_tan": R(0.08, 0.20)}

    def wheels(self, s):
        s.speed = s.speed * (1 - self.loss_per_tan * np.abs(np.tan(s.angle)).sum(axis=1))


class BatteryDroop(Cause):
    ranges = {"loss_per_hour": R(0.05, 0.12)}

    def command(self, s):
        s.speed_target *= 1 - self.loss_per_hour * s.clock / 3600


class LateralSlip(Cause):
    ranges = {"loss_at_top_speed": R(0.10, 0.25)}

    def linkage(self, s):
        steer_outward(s, self.loss_at_top_speed / (1 - self.loss_at_top_speed) / self.vehicle.top[0] ** 2)


class WheelDiameterMismatch(Cause):
    """Right wheels larger than left ones; the yaw that they force is that at which the tyres' slip balances."""

    ranges = {"curvature_1_m": R(0.03, 0.10, signed=True)}

    def prepare(self, s):
        v = self.vehicle
        # least slip: sum over wheels of y² + x² (about the axles' middle) against the sum of |y| · mismatch
        self.share = self.curvature_1_m * (v.track**2 + v.wheelbase**2) / (2 * v.track)

    def wheels(self, s):
        s.factor *= 1 + self.share * np.array([-1, 1, -1, 1])


class AxleSpeedMismatch(Cause):
    ranges = {"rear_over_front": R(0.08, 0.20, signed=True)}

    def wheels(self, s):
        e = self.rear_over_front / 2
        s.factor *= np.array([1 - e, 1 - e, 1 + e, 1 + e])


class FloorTilt(Cause):
    ranges = {"drift_mm_s": R(8, 20), "direction_rad": DIRECTION}

    def forces(self, s):
        drift = self.drift_mm_s / 1000 * np.array([np.cos(self.direction_rad), np.sin(self.direction_rad)])
        s.floor += moving(s)[:, None] * drift


class MocapLatency(Cause):
    ranges = {"late_s": R(0.030, 0.080, signed=True)}

    def stamp(self, started):
        return self.late_s


class MarkerOffset(Cause):
    ranges = {"distance_mm": R(10, 25), "direction_rad": DIRECTION}

    def pose(self, x, y, h, started):
        dx, dy = rotate(h + self.direction_rad, self.distance_mm / 1000, 0.0)
        return x + dx, y + dy, h


class HeadingMisalignment(Cause):
    ranges = {"angle_deg": R(1.5, 4, signed=True)}

    def pose(self, x, y, h, started):
        return x, y, h + self.angle_deg * DEG


class MocapScale(Cause):
    ranges = {"scale_error": R(0.015, 0.03, signed=True)}

    def pose(self, x, y, h, started):
        return x * (1 + self.scale_error), y * (1 + self.scale_error), h


# -- outside


class BaseOutside(Cause):
    kind = "outside"


class TyreSaturation(BaseOutside):
    """Slippery tyres: soft, and the lateral force of each saturates below what tight fast turns demand."""

    ranges = {"limit_m_s2": R(0.14, 0.22, -1), "stiffness_n": R(50, 90, 0)}

    def prepare(self, s):
        s.stiffness = np.full(4, self.stiffness_n)
        s.motor_slope = 4 * 0.02  # otherwise four stiff motors would hold the course
        s.lateral_limit = self.limit_m_s2 * self.vehicle.mass / 4


class InclinedFloor(BaseOutside):
    """Gravity along an inclined floor on a soft motor and soft tyres."""

    ranges = {"slope_deg": R(0.8, 1.5), "direction_rad": DIRECTION, "slope_m_s_n": R(0.02, 0.035, 0)}

    def prepare(self, s):
        s.stiffness = np.full(4, 25.0)
        s.motor_slope = 4 * self.slope_m_s_n

    def forces(self, s):
        pull = self.vehicle.mass * GRAVITY * np.sin(self.slope_deg * DEG)
        s.force += pull * np.array([np.cos(self.direction_rad), np.sin(self.direction_rad)])


class Tether(BaseOutside):
    """A cable pulls the vehicle's tail towards a point of the room, more the longer it is."""

    ranges = {"pull_n": R(0.25, 0.45), "per_m_n": R(0.15, 0.35), "x_m": R(-1.5, 1.5, 0), "y_m": R(-1.5, 1.5, 0)}

    def prepare(self, s):
        s.stiffness = np.full(4, 22.0)
        s.motor_slope = 4 * 0.03

    def forces(self, s):
        hook = self.vehicle.rear + 0.05
        dx = self.x_m - (s.x - hook * np.cos(s.h))
        dy = self.y_m - (s.y - hook * np.sin(s.h))
        length = np.hypot(dx, dy)
        pull = (self.pull_n + self.per_m_n * length) * np.minimum(length / 0.2, 1) / np.maximum(length, 1e-3)
        force = np.stack([pull * dx, pull * dy], axis=1)
        s.force += force
        s.moment += -hook * (np.cos(s.h) * force[:, 1] - np.sin(s.h) * force[:, 0])


class ServoSag(BaseOutside):
    """Moving servos load the supply, which recovers slowly: speed sags after each steering movement."""

    ranges = {"sag_per_rad": R(0.35, 0.6), "recovery_s": R(0.5, 0.9, 0)}

    def prepare(self, s):
        self.sag = np.zeros(s.n)
        self.before = None

    def command(self, s):
        if self.before is not None:
            self.sag += self.sag_per_rad * np.abs(s.angle_target - self.before).sum(axis=1)
        self.before = s.angle_target.copy()
        self.sag = np.minimum(self.sag * np.exp(-DT / self.recovery_s), 0.6)
        s.speed_target *= 1 - self.sag


class ServoRinging(BaseOutside):
    """Servos swing about their target, slowly and hardly damped."""

    ranges = {"frequency_hz": R(0.5, 0.9, -1), "damping": R(0.10, 0.22, 0)}

    def prepare(self, s):
        s.servo_model = self.servo
        self.rate = np.zeros((s.n, 2))

    def servo(self, s):
        w = 2 * np.pi * self.frequency_hz
        self.rate += DT * (w**2 * (s.angle_target - s.servo) - 2 * self.damping * w * self.rate)
        s.servo += DT * self.rate
        stop = 40 * DEG
        hit = np.abs(s.servo) > stop
        s.servo = np.clip(s.servo, -stop, stop)
        self.rate[hit] = 0


class StickAtStart(BaseOutside):
    """Stiction: from rest, the wheels break away only after some time, the longer the weaker the drive."""

    ranges = {"hold_s": R(0.09, 0.17), "jump": R(0.0, 0.3)}

    def prepare(self, s):
        self.waited = np.zeros(s.n)
        self.since = np.zeros(s.n)

    def command(self, s):
        want = np.abs(s.speed_target)
        rest = want < 0.004
        self.waited = np.where(rest, 0, self.waited + DT * want / self.vehicle.top[0])
        stuck = self.waited < self.hold_s
        self.since = np.where(stuck, 0, self.since + DT)
        s.speed_target = np.where(stuck, 0, s.speed_target * (1 + self.jump * np.exp(-self.since / 0.15)))


class ReversalPlay(BaseOutside):
    """Play in the drive train: after each reversal the motor turns for a while before the wheels do."""

    ranges = {"play_mm": R(35, 60)}

    def prepare(self, s):
        self.half = self.play_mm / 2000
        self.gap = np.full(s.n, self.half)  # runs begin with the train tight for driving ahead

    def command(self, s):
        gap = self.gap + s.speed_target * DT
        s.speed_target = np.where(np.abs(gap) < self.half, 0, s.speed_target)
        self.gap = np.clip(gap, -self.half, self.half)


class LensDistortion(BaseOutside):
    ranges = {"per_m2": R(0.009, 0.016, signed=True)}

    def pose(self, x, y, h, started):
        stretch = 1 + self.per_m2 * (x**2 + y**2)
        return x * stretch, y * stretch, h


class CameraTilt(BaseOutside):
    """A projective error: the scale varies along one direction of the room."""

    ranges = {"per_m": R(0.018, 0.03), "direction_rad": DIRECTION}

    def pose(self, x, y, h, started):
        scale = 1 / (1 - self.per_m * (x * np.cos(self.direction_rad) + y * np.sin(self.direction_rad)))
        return x * scale, y * scale, h


class RubbingWheel(BaseOutside):
    """The front left wheel rubs at large angles to one side: it and thus the vehicle are slowed."""

    ranges = {"from_deg": R(14, 19, 0), "loss": R(0.12, 0.22), "side": R(1, 1, 0, signed=True)}

    def wheels(self, s):
        over = np.clip((self.side * s.angle[:, 0] / DEG - self.from_deg) / 3, 0, 1)
        s.speed = s.speed * (1 - 0.6 * self.loss * over)
        s.factor[:, 0] *= 1 - 0.4 * self.loss * over


class FrontGainBySpeed(BaseOutside):
    """Caster in the front axle: its deflection grows with speed; the rear axle keeps its angle."""

    ranges = {"gain_at_top_speed": R(0.12, 0.22)}

    def linkage(self, s):
        gain = 1 + self.gain_at_top_speed * (np.abs(s.speed) / self.vehicle.top[0] - 0.5)
        s.angle = s.angle * np.stack([gain, np.ones(s.n)], axis=1)


class OneSidedBrake(BaseOutside):
    """Stopping takes a while, and meanwhile the wheels of one side hardly turn: the vehicle yaws at each stop."""

    ranges = {"coast_s": R(0.14, 0.22), "left_share": R(0.15, 0.3, 0), "side": R(1, 1, 0, signed=True)}

    def prepare(self, s):
        s.drive_tau = [s.drive_tau[0], self.coast_s]

    def wheels(self, s):
        brakes = (np.abs(s.speed_target) < 0.004) & (np.abs(s.speed) > 1e-4)
        columns = [0, 2] if self.side > 0 else [1, 3]
        s.factor[np.ix_(brakes, columns)] *= self.left_share


class MotorWarming(BaseOutside):
    """The motor warms while it runs and becomes slower within the run; it is cold again at the next."""

    ranges = {"loss": R(0.07, 0.12), "tau_s": R(1.5, 3.0, 0)}

    def prepare(self, s):
        self.heat = np.zeros(s.n)

    def command(self, s):
        runs = np.abs(s.speed_target) > 0.004
        self.heat += DT * (runs - self.heat) / self.tau_s
        s.speed_target *= 1 - self.loss * self.heat


class CarpetPatch(BaseOutside):
    """Wheels on a round piece of carpet advance less."""

    ranges = {"x_m": R(-0.6, 0.6, 0), "y_m": R(-0.6, 0.6, 0), "radius_m": R(0.6, 0.85, 0), "loss": R(0.07, 0.12)}

    def wheels(self, s):
        dx, dy = rotate(s.h[:, None], s.wheel_x[None], s.wheel_y[None])
        distance = np.hypot(s.x[:, None] + dx - self.x_m, s.y[:, None] + dy - self.y_m)
        s.factor *= 1 - self.loss * np.clip((self.radius_m - distance) / 0.02, 0, 1)


class RelaxationLength(BaseOutside):
    """Tyres take up a new angle over a distance, not over a time."""

    ranges = {"length_m": R(0.04, 0.08)}

    def prepare(self, s):
        self.taken = np.tile(self.vehicle.offset, (s.n, 1))

    def linkage(self, s):
        share = -np.expm1(-np.abs(s.speed) * DT / self.length_m)[:, None]
        self.taken += share * (s.angle - self.taken)
        s.angle = self.taken.copy()


class AsymmetricServoSpeed(BaseOutside):
    """Weak servos: slow to one side, quick to the other."""

    ranges = {"slow_rad_s": R(0.45, 0.7, -1), "side": R(1, 1, 0, signed=True)}

    def prepare(self, s):
        s.servo_rate = [self.slow_rad_s, 8.0] if self.side < 0 else [8.0, self.slow_rad_s]


class SpeedOvershoot(BaseOutside):
    """A speed controller whose integral part swings; at neutral the brake stops the motor and the integral."""

    ranges = {"frequency_rad_s": R(3.5, 5.5, -1), "damping": R(0.2, 0.35, 0)}

    def prepare(self, s):
        s.drive_model = self.controller
        self.push = np.zeros(s.n)

    def controller(self, s):
        w = self.frequency_rad_s
        braked = np.abs(s.speed_target) < 0.004
        self.push += DT * w**2 * (s.speed_target - s.drive)
        self.push[braked] = 0
        s.drive += DT * (self.push - 2 * self.damping * w * s.drive)
        s.drive[braked] *= np.exp(-DT / self.vehicle.drive_tau)


class TorqueSteer(BaseOutside):
    """The motor's torque twists the front axle, to one side when driving ahead and to the other when backward."""

    ranges = {"twist_deg": R(0.7, 1.2, signed=True)}

    def linkage(self, s):
        s.angle[:, 0] += self.twist_deg * DEG * s.direction * moving(s)


# -- time


class BaseTime(Cause):
    kind = "time"


class FadingSteeringGain(BaseTime):
    ranges = {"loss_per_hour": R(0.09, 0.17)}

    def linkage(self, s):
        s.angle = s.angle * (1 - self.loss_per_hour * s.clock / 3600)[:, None]


class BumpedMarker(BaseTime):
    ranges = {
        "at_share": R(0.35, 0.65, 0),
        "turn_deg": R(2, 4, signed=True),
        "shift_mm": R(8, 16),
        "direction_rad": DIRECTION,
    }

    def pose(self, x, y, h, started):
        if started < self.at_share * self.length:
            return x, y, h
        dx, dy = rotate(h + self.direction_rad, self.shift_mm / 1000, 0.0)
        return x + dx, y + dy, h + self.turn_deg * DEG


class BatteryChange(BaseTime):
    ranges = {"at_share": R(0.35, 0.65, 0), "gain": R(0.05, 0.09)}

    def command(self, s):
        s.speed_target *= np.where(s.campaign.started < self.at_share * self.length, 1, 1 + self.gain)


class WarmUp(BaseTime):
    ranges = {"loss_when_cold": R(0.10, 0.18), "tau_s": R(600, 1000, 0)}

    def command(self, s):
        s.speed_target *= 1 - self.loss_when_cold * np.exp(-s.clock / self.tau_s)


class WindEpisode(BaseTime):
    """A fan blows in one part of the campaign and makes the moving vehicle creep."""

    ranges = {
        "from_share": R(0.2, 0.5, 0),
        "share": R(0.25, 0.4, 0),
        "drift_mm_s": R(10, 20),
        "direction_rad": DIRECTION,
    }

    def forces(self, s):
        share = s.campaign.started / self.length
        blows = (share > self.from_share) & (share < self.from_share + self.share)
        drift = self.drift_mm_s / 1000 * np.array([np.cos(self.direction_rad), np.sin(self.direction_rad)])
        s.floor += (moving(s) * blows)[:, None] * drift


class CameraClockDrift(BaseTime):
    ranges = {"late_s_per_hour": R(0.08, 0.16, signed=True)}

    def stamp(self, started):
        return self.late_s_per_hour * started / 3600


class TrimStep(BaseTime):
    ranges = {"at_share": R(0.3, 0.7, 0), "front_deg": R(1.2, 2.4, signed=True)}

    def linkage(self, s):
        s.angle[:, 0] += np.where(s.campaign.started < self.at_share * self.length, 0, self.front_deg * DEG)


class DustyFloor(BaseTime):
    """Dust gathers: the understeer of fast turns grows from nothing through the campaign."""

    ranges = {"loss_at_end": R(0.2, 0.32)}

    def linkage(self, s):
        loss = self.loss_at_end * np.minimum(s.clock / self.length, 1.05)
        steer_outward(s, loss / (1 - loss) / self.vehicle.top[0] ** 2)


# -------------------------------------------------------------------------------------------------------- output


def record(campaign, causes, truth):
    """The camera's frames of all runs as a table."""
    v, parts = campaign.vehicle, []
    r = generator(v.number, campaign.seed, "camera")
    for i, (_, name, repeat, rows) in enumerate(campaign.runs):
        started = campaign.started[i]
        stamps = np.arange(-0.5 + r.uniform(0, 1 / v.rate), rows[-1][0] + 1.0, 1 / v.rate)
        late = sum(cause.stamp(started) for cause in causes)
        x, y, h = (np.interp(stamps - late, campaign.t, truth[j, :, i]) for j in range(3))
        for cause in causes:
            x, y, h = cause.pose(x, y, h, started)
        count = len(stamps)
        x = x + r.normal(0, v.position_sd, count)
        y = y + r.normal(0, v.position_sd, count)
        h = h + r.normal(0, v.heading_sd, count)
        tracked = r.random(count) >= v.lost
        x[~tracked] = y[~tracked] = h[~tracked] = np.nan
        h = (h + np.pi) % (2 * np.pi) - np.pi
        parts.append(
            pd.DataFrame(
                {
                    "run_id": f"{name}-r{repeat:02d}",
                    "t_s": stamps,
                    "x_m": x,
                    "y_m": y,
                    "heading_rad": h,
                    "tracked": tracked,
                    "frame": int(started * v.rate) + np.arange(count),
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def write(directory, number, names, scale, seed):
    directory = Path(directory)
    unknown = [name for name in names if name not in CAUSES]
    if unknown:
        sys.exit(f"unknown cause: {', '.join(unknown)}")
    if directory.exists():
        sys.exit(f"{directory} exists")
    vehicle = Vehicle(number)
    campaign = Campaign(vehicle, seed)
    causes = [CAUSES[name](vehicle, scale, campaign.length) for name in CAUSES if name in names]
    truth = Simulation(campaign, causes).run()
    poses = record(campaign, causes, truth)

    runs, commands = [], []
    for (experiment, name, repeat, rows), started in zip(campaign.runs, campaign.started):
        run_id = f"{name}-r{repeat:02d}"
        runs.append((run_id, experiment, name, "", repeat, np.nan, np.nan, np.nan, started, "ok", ""))
        commands += [(run_id, t, float(d), float(f), float(b)) for t, d, f, b in rows]
    columns = "run_id experiment trajectory condition repeat target_x_m target_y_m target_heading_rad started_s"
    runs = pd.DataFrame(runs, columns=[*columns.split(), "status", "firmware"])
    commands = pd.DataFrame(commands, columns=["run_id", "t_s", "drive", "front", "rear"])

    directory.mkdir(parents=True)
    (directory / "campaign.toml").write_text(
        f'schema = 1\nname = "rigid-body-{number}"\n\n[vehicle]\nname = "rigid-body-{number}"\n'
        f"front_axle_m = {vehicle.stated_front}\nrear_axle_m = {vehicle.stated_rear}\n"
        f'command_unit = "us"\nneutral = {float(NEUTRAL)}\n\n[mocap]\nrate_hz = {vehicle.rate}\n'
    )
    for name, table in (("poses", poses), ("commands", commands), ("runs", runs)):
        table.to_parquet(directory / f"{name}.parquet", index=False)
    facts = {
        "vehicle": number,
        "seed": seed,
        "causes": {cause.name: cause.parameters for cause in causes},
    }
    directory.with_name(directory.name + ".truth.json").write_text(json.dumps(facts, indent=2) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    actions = parser.add_subparsers(dest="action", required=True)
    actions.add_parser("list")
    p = actions.add_parser("write")
    p.add_argument("directory")
    p.add_argument("--vehicle", type=int, required=True)
    p.add_argument("--causes", default="")
    p.add_argument("--scale", type=float, default=1.0)
    p.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    if args.action == "list":
        print(json.dumps({name: cause.kind for name, cause in CAUSES.items()}, indent=2))
    else:
        names = [name.strip() for name in args.causes.split(",") if name.strip()]
        write(args.directory, args.vehicle, names, args.scale, args.seed)


if __name__ == "__main__":
    main()
