# mypy: disallow-untyped-decorators=False, warn-return-any=False
"""The integrator: one compiled step of a simulated vehicle, on a fixed grid of 1/1200 s.

Unknowns are the body's speed U along its axis and the two servos; the wheels' constraints (no axle moves
laterally) give the rest: with the axles at lf and −lr, ``V + lf r = U tan δf`` and ``V − lr r = U tan δr``.

The grid does not depend on how `advance` is called: a call that ends inside a cell returns a partial step from the
cell's start, and the next call takes the cell from its start again. So grid states are the same bit for bit however
the time is split, and a split changes a result by rounding only.
"""

from __future__ import annotations

import math

import numpy as np

from agvbench.compiled import cached_njit
from agvbench.simulator.time_grid import whole_steps
from agvbench.types import Floats

STEP_S = 1.0 / 1200.0
FRAME_STEPS = 24
"""Steps per pulse frame of 20 ms."""

# The state: pose of the marker centroid, body, servos, charge; then the commands on their way.
STATE_NAMES = (
    *("x_m", "y_m", "heading_rad", "speed_mps", "windup_m", "slack_m"),
    *("front_rad", "front_rate_rad_per_s", "rear_rad", "rear_rate_rad_per_s", "charge_ah"),
)
X, Y, HEADING, SPEED, WINDUP, SLACK, FRONT_ANGLE, FRONT_RATE, REAR_ANGLE, REAR_RATE, CHARGE = range(11)
MOVING = len(STATE_NAMES)
AIMS = MOVING  # wheel speed, front and rear servo: what the latched command asks for
QUEUE = AIMS + 3  # ring of pulse frames of 3 commands
RING = 8
REMAINDER = QUEUE + 3 * RING  # time since the last grid point
STATE_SIZE = REMAINDER + 1

# Counters (integers): steps since the reset plus the run's phase in the pulse frame, head of the ring.
STEPS, RING_HEAD = 0, 1

# Where the constants lie in `SimulatedVehicle.pack()`.
FRONT, REAR, FORWARD, BACKWARD = 0, 9, 18, 23
SLOPE, CUBIC, OFFSET, STOP_LOW, STOP_HIGH, COMPLIANCE, FREQUENCY, DAMPING, RATE_LIMIT = range(9)
DEAD_BAND, KNEE, UNLOADED, FULL, ACCELERATION = range(5)
SENSE, STIFFNESS, OVERRUN, REAR_RATIO, SCRUB, SCRUB_DRY = range(28, 34)
BRAKE, BRAKE_DRY, WINDUP_RATE, WINDUP_RELAXES, DRIVE_BACKLASH = range(34, 39)
FRONT_AXLE, REAR_AXLE, MARKER_LEFT, RELIEF, UNDERSTEER = range(39, 44)
CAPACITY, RUNNING, DROOP, SHAPE = range(44, 48)
NEUTRAL, COMMAND_LOW, COMMAND_HIGH, DELAY_FRAMES = range(51, 55)

_RELIEF_SPEED = 0.02  # m/s: reversing wheels have closed the linkage's play above it
_CREEP = 0.004  # m/s: dry friction is smooth below it
_SECONDS_PER_HOUR = 3600.0
_SLACK_OPENS = 0.05  # s: without power the drive train comes off its flanks within this


@cached_njit()
def servo_target(p: Floats, base: int, offset: float) -> float:
    """Return the axle angle [rad] that a servo aims at, `offset` command units from neutral."""
    angle = p[base + OFFSET] + offset * (p[base + SLOPE] + p[base + CUBIC] * offset * offset)
    low, high = p[base + STOP_LOW], p[base + STOP_HIGH]
    if angle > high:
        return high + p[base + COMPLIANCE] * (angle - high)
    if angle < low:
        return low + p[base + COMPLIANCE] * (angle - low)
    return angle


@cached_njit()
def speed_target(p: Floats, offset: float) -> float:
    """Return the signed wheel speed [m/s] that the drive aims at with a full battery; 0 when unpowered."""
    ahead = p[SENSE] * offset
    side = FORWARD if ahead > 0.0 else BACKWARD
    y = abs(ahead) - p[side + DEAD_BAND]
    if y <= 0.0:
        return 0.0
    return math.copysign(min(p[side + FULL], p[side + UNLOADED] * y / (y + p[side + KNEE])), ahead)


@cached_njit()
def _wheel_tangents(p: Floats, run_variation: Floats, at: Floats) -> tuple[float, float]:
    """Return tan δ of front and rear wheels: the servos' plus play, less what compliance takes in reverse."""
    back = min(1.0, max(0.0, -at[SPEED] / _RELIEF_SPEED))
    share = 1.0 - p[RELIEF] * back * back * (3.0 - 2.0 * back)
    return math.tan(share * (at[FRONT_ANGLE] + run_variation[0])), math.tan(share * (at[REAR_ANGLE] + run_variation[1]))


@cached_njit()
def _pull(p: Floats, wheel_mps: float, cos_angle: float, speed: float) -> float:
    """Return an axle's pull on the body over its stiffness [m/s]: stiffer when it holds the body back."""
    error = wheel_mps * cos_angle - speed
    return error if error * wheel_mps >= 0.0 else p[OVERRUN] * error


@cached_njit()
def _powered(p: Floats, wheel_mps: float, tan_front: float, tan_rear: float, speed: float) -> float:
    """Return the body's acceleration [m/s²] under power."""
    half = 0.5 * (p[REAR_RATIO] - 1.0)
    pull = _pull(p, wheel_mps * (1.0 - half), 1.0 / math.sqrt(1.0 + tan_front * tan_front), speed)
    pull += _pull(p, wheel_mps * (1.0 + half), 1.0 / math.sqrt(1.0 + tan_rear * tan_rear), speed)
    dry = p[SCRUB_DRY] * min(1.0, max(-1.0, speed / _CREEP))
    scrub = (abs(tan_front) + abs(tan_rear)) * (p[SCRUB] * speed + dry)
    limit = p[(FORWARD if wheel_mps > 0.0 else BACKWARD) + ACCELERATION]
    return min(limit, max(-limit, p[STIFFNESS] * (0.5 * pull - scrub)))


@cached_njit()
def _servo_acceleration(p: Floats, base: int, target: float, angle: float, rate: float) -> float:
    """Return a servo's angular acceleration [rad/s²]: second order, its rate bounded."""
    omega, limit = p[base + FREQUENCY], p[base + RATE_LIMIT]
    wanted = omega * (target - angle) / (2.0 * p[base + DAMPING])
    return 2.0 * p[base + DAMPING] * omega * (min(limit, max(-limit, wanted)) - rate)


@cached_njit()
def _derivative(p: Floats, run_variation: Floats, state: Floats, at: Floats, out: Floats) -> None:
    """Write the time derivative at the moving state `at`, under the aims in `state`."""
    wheel, speed = state[AIMS], at[SPEED]
    tan_front, tan_rear = _wheel_tangents(p, run_variation, at)
    spring = -p[WINDUP_RATE] * at[WINDUP]
    out[WINDUP] = -at[WINDUP] / p[WINDUP_RELAXES]
    if wheel != 0.0:
        closed = min(1.0, at[SLACK] / p[DRIVE_BACKLASH]) if p[DRIVE_BACKLASH] > 0.0 else 1.0
        out[SLACK] = abs(wheel) if closed < 1.0 else 0.0
        out[SPEED] = closed**3 * _powered(p, wheel, tan_front, tan_rear, speed) + spring
    else:
        out[SLACK] = -at[SLACK] / _SLACK_OPENS
        out[WINDUP] += speed
        out[SPEED] = spring - p[BRAKE] * speed - p[BRAKE_DRY] * math.tanh(speed / _CREEP)
    out[FRONT_ANGLE], out[REAR_ANGLE] = at[FRONT_RATE], at[REAR_RATE]
    out[FRONT_RATE] = _servo_acceleration(p, FRONT, state[AIMS + 1], at[FRONT_ANGLE], at[FRONT_RATE])
    out[REAR_RATE] = _servo_acceleration(p, REAR, state[AIMS + 2], at[REAR_ANGLE], at[REAR_RATE])
    out[CHARGE] = p[RUNNING] * abs(wheel) / p[(FORWARD if wheel > 0.0 else BACKWARD) + FULL] / _SECONDS_PER_HOUR
    # No axle moves laterally, save for what understeer lets go.
    base = (p[FRONT_AXLE] + p[REAR_AXLE]) * (1.0 + p[UNDERSTEER] * speed * speed)
    yaw_rate = speed * (tan_front - tan_rear) / base
    ahead, left = speed - p[MARKER_LEFT] * yaw_rate, speed * tan_rear + p[REAR_AXLE] * yaw_rate
    c, s = math.cos(at[HEADING]), math.sin(at[HEADING])
    out[X], out[Y], out[HEADING] = c * ahead - s * left, s * ahead + c * left, yaw_rate


@cached_njit()
def _latch(
    p: Floats, run_variation: Floats, state: Floats, counters: np.ndarray, command: tuple[float, float, float]
) -> None:
    """Begin a pulse frame: queue the command and aim for the one of `delay_frames` frames ago."""
    head = counters[RING_HEAD]
    obeyed = QUEUE + 3 * ((head - int(p[DELAY_FRAMES])) % RING)
    for i in range(3):
        state[QUEUE + 3 * head + i] = command[i] - p[NEUTRAL]
    counters[RING_HEAD] = (head + 1) % RING
    left = max(0.0, 1.0 - p[DROOP] * (state[CHARGE] / p[CAPACITY]) ** p[SHAPE])
    state[AIMS] = speed_target(p, state[obeyed]) * left * (1.0 + run_variation[2])
    state[AIMS + 1] = servo_target(p, FRONT, state[obeyed + 1])
    state[AIMS + 2] = servo_target(p, REAR, state[obeyed + 2])


@cached_njit()
def _step(p: Floats, run_variation: Floats, state: Floats, dt: float, work: Floats) -> None:
    """Write into ``work[2]`` the moving state `dt` later, by Heun's method; `work` has shape (3, MOVING)."""
    _derivative(p, run_variation, state, state, work[0])
    for i in range(MOVING):
        work[2, i] = state[i] + dt * work[0, i]
    _derivative(p, run_variation, state, work[2], work[1])
    for i in range(MOVING):
        work[2, i] = state[i] + 0.5 * dt * (work[0, i] + work[1, i])


@cached_njit()
def advance(
    p: Floats, run_variation: Floats, state: Floats, counters: np.ndarray, work: Floats, drive: float, front: float,
    rear: float, dt: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Hold the command for `dt` seconds; return the pose then. `work` has shape (3, MOVING)."""
    low, high = p[COMMAND_LOW], p[COMMAND_HIGH]
    command = (min(high, max(low, drive)), min(high, max(low, front)), min(high, max(low, rear)))
    begun = state[REMAINDER] > 0.0  # the first cell is under way: its pulse frame has been read
    cells, remainder = whole_steps(state[REMAINDER] + dt, STEP_S)
    for cell in range(cells + (remainder > 0.0)):
        if not begun and counters[STEPS] % FRAME_STEPS == 0:
            _latch(p, run_variation, state, counters, command)
        begun = False
        if cell < cells:
            _step(p, run_variation, state, STEP_S, work)
            state[:MOVING] = work[2]
            counters[STEPS] += 1
    state[REMAINDER] = remainder
    if remainder == 0.0:
        return state[X], state[Y], state[HEADING]
    _step(p, run_variation, state, remainder, work)
    return work[2, X], work[2, Y], work[2, HEADING]
