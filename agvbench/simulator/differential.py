# mypy: disallow-untyped-decorators=False, warn-return-any=False
"""A simulated differential vehicle: two driven wheels with speed controllers of their own.

Commands are a speed and a yaw rate; the controller turns them into wheel speeds with the radius and track that it
assumes. The wheels' true radii and the track that scrubs differ from them. The integrator has a fixed grid of 1 ms, so
that how time is split changes a result by rounding only.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, replace

import numpy as np

from agvbench.compiled import cached_njit
from agvbench.simulator.checked_plant import checked_advance, checked_delay, checked_pose
from agvbench.simulator.random_streams import random_stream
from agvbench.simulator.time_grid import whole_steps
from agvbench.types import Floats

STEP_S = 0.001
FRAME_STEPS = 20
"""Steps from one reading of the command to the next."""
MAX_DELAY_FRAMES = 14
_RING = 16


@dataclass(frozen=True, slots=True)
class DifferentialVehicle:
    """Constants of a differential vehicle; the defaults are a small robot of no maker.

    Parameters
    ----------
    assumed_track_m, true_track_m
        Distance between the wheels [m]: the controller's, and the one about which the body really turns.
    left_radius, right_radius
        True radius of each wheel over the one that the controller assumes.
    natural_frequency_rad_per_s, damping_ratio
        Of the wheels' speed controllers, which are of second order.
    acceleration_mps2
        What a wheel's motor can do at most [m/s²].
    fastest_mps
        Fastest speed of a wheel [m/s]; a command beyond it is slowed with its curvature kept.
    slip_s2_per_m2
        The yaw rate falls by 1 / (1 + slip v²).
    marker_forward_m, marker_left_m
        From the middle of the axle to the markers' centroid [m].
    droop_per_hour
        Loss of speed while driving [1/h].
    delay_frames
        Frames of 20 ms until a command is obeyed.
    wheel_scatter
        Standard deviation of each wheel's speed from run to run, as a share.
    neutral, speed_per_unit, yaw_rate_per_unit, command_limit
        Speed [m/s] and yaw rate [rad/s] that the controller takes one command unit for; commands are clipped at
        `command_limit` units from neutral.
    """

    assumed_track_m: float = 0.30
    true_track_m: float = 0.33
    left_radius: float = 0.955
    right_radius: float = 0.965
    natural_frequency_rad_per_s: float = 14.0
    damping_ratio: float = 0.8
    acceleration_mps2: float = 5.0
    fastest_mps: float = 0.6
    slip_s2_per_m2: float = 0.15
    marker_forward_m: float = 0.052
    marker_left_m: float = 0.003
    droop_per_hour: float = 0.01
    delay_frames: float = 2.0
    wheel_scatter: float = 0.001
    neutral: float = 0.0
    speed_per_unit: float = 1.0
    yaw_rate_per_unit: float = 1.0
    command_limit: float = 2.0


# Where the constants lie in `astuple`, and what the state holds.
ASSUMED_TRACK, TRACK, LEFT_RADIUS, RIGHT_RADIUS, FREQUENCY, DAMPING, ACCELERATION, FASTEST = range(8)
SLIP, MARKER_FORWARD, MARKER_LEFT, DROOP, DELAY, SCATTER, NEUTRAL, SPEED_UNIT, YAW_UNIT, LIMIT = range(8, 18)
X, Y, HEADING, LEFT, LEFT_RATE, RIGHT, RIGHT_RATE, HOURS = range(8)
MOVING = 8
AIM_LEFT, AIM_RIGHT, REMAINDER, QUEUE = 8, 9, 10, 11
STATE_SIZE = QUEUE + 2 * _RING


@cached_njit()
def _body(p: Floats, variation: Floats, at: Floats) -> tuple[float, float]:
    """Return forward speed of the axle's middle [m/s] and yaw rate [rad/s]."""
    left = at[LEFT] * p[LEFT_RADIUS] * (1.0 + variation[0])
    right = at[RIGHT] * p[RIGHT_RADIUS] * (1.0 + variation[1])
    forward = 0.5 * (left + right)
    return forward, (right - left) / p[TRACK] / (1.0 + p[SLIP] * forward * forward)


@cached_njit()
def _derivative(p: Floats, variation: Floats, state: Floats, at: Floats, out: Floats) -> None:
    """Write the time derivative at `at`, under the aims in `state`."""
    forward, yaw_rate = _body(p, variation, at)
    left = yaw_rate * p[MARKER_FORWARD]
    ahead = forward - yaw_rate * p[MARKER_LEFT]
    c, s = math.cos(at[HEADING]), math.sin(at[HEADING])
    out[X], out[Y], out[HEADING] = c * ahead - s * left, s * ahead + c * left, yaw_rate
    omega = p[FREQUENCY]
    for wheel in (LEFT, RIGHT):
        aim = state[AIM_LEFT] if wheel == LEFT else state[AIM_RIGHT]
        wanted = omega * (aim - at[wheel]) / (2.0 * p[DAMPING])
        bounded = min(p[ACCELERATION], max(-p[ACCELERATION], wanted))
        out[wheel] = at[wheel + 1]
        out[wheel + 1] = 2.0 * p[DAMPING] * omega * (bounded - at[wheel + 1])
    out[HOURS] = (1.0 if abs(at[LEFT]) + abs(at[RIGHT]) > 1e-3 else 0.0) / 3600.0


@cached_njit()
def _latch(p: Floats, state: Floats, counters: np.ndarray, speed: float, yaw_rate: float) -> None:
    """Read the command, and aim for the one of `delay_frames` frames ago."""
    head = counters[1]
    state[QUEUE + 2 * head], state[QUEUE + 2 * head + 1] = speed, yaw_rate
    obeyed = QUEUE + 2 * ((head - int(p[DELAY])) % _RING)
    counters[1] = (head + 1) % _RING
    half = 0.5 * p[ASSUMED_TRACK] * state[obeyed + 1]
    left, right = state[obeyed] - half, state[obeyed] + half
    too_fast = max(abs(left), abs(right)) / p[FASTEST]
    share = max(0.0, 1.0 - p[DROOP] * state[HOURS]) / max(1.0, too_fast)
    state[AIM_LEFT], state[AIM_RIGHT] = share * left, share * right


@cached_njit()
def _step(p: Floats, variation: Floats, state: Floats, dt: float, work: Floats) -> None:
    """Write into ``work[2]`` the moving state `dt` later, by Heun's method; `work` has shape (3, MOVING)."""
    _derivative(p, variation, state, state, work[0])
    for i in range(MOVING):
        work[2, i] = state[i] + dt * work[0, i]
    _derivative(p, variation, state, work[2], work[1])
    for i in range(MOVING):
        work[2, i] = state[i] + 0.5 * dt * (work[0, i] + work[1, i])


@cached_njit()
def advance(
    p: Floats, variation: Floats, state: Floats, counters: np.ndarray, work: Floats, drive: float, front: float,
    dt: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Hold the command for `dt` seconds; return the pose then."""
    limit = p[LIMIT]
    speed = p[SPEED_UNIT] * min(limit, max(-limit, drive - p[NEUTRAL]))
    yaw_rate = p[YAW_UNIT] * min(limit, max(-limit, front - p[NEUTRAL]))
    begun = state[REMAINDER] > 0.0  # the first cell is under way: its command has been read
    cells, remainder = whole_steps(state[REMAINDER] + dt, STEP_S)
    for cell in range(cells + (remainder > 0.0)):
        if not begun and counters[0] % FRAME_STEPS == 0:
            _latch(p, state, counters, speed, yaw_rate)
        begun = False
        if cell < cells:
            _step(p, variation, state, STEP_S, work)
            state[:MOVING] = work[2]
            counters[0] += 1
    state[REMAINDER] = remainder
    if remainder == 0.0:
        return state[X], state[Y], state[HEADING]
    _step(p, variation, state, remainder, work)
    return work[2, X], work[2, Y], work[2, HEADING]


class DifferentialPlant:
    """A simulated differential vehicle behind the plant protocol: `drive` is its speed, `front` its yaw rate.

    Equal calls give equal poses bit for bit. The heading is continuous over full turns.

    Parameters
    ----------
    vehicle
        Its constants.
    seed
        Seeds, together with the seed of each reset, what varies from run to run.

    Examples
    --------
    >>> from agvbench.simulator import differential_plant
    >>> plant = differential_plant(0)
    >>> plant.reset((0.0, 0.0, 0.0), seed=1)
    >>> x, y, heading = plant.advance(0.3, 0.0, 0.0, 5.0)
    >>> 1.3 < x < 1.5
    True
    """

    def __init__(self, vehicle: DifferentialVehicle, seed: int) -> None:
        checked_delay(vehicle.delay_frames, MAX_DELAY_FRAMES)
        self.vehicle, self._seed = vehicle, seed
        self._constants = np.array(astuple(vehicle), dtype=np.float64)
        self._state, self._counters = np.zeros(STATE_SIZE), np.zeros(2, dtype=np.int64)
        self._variation, self._work = np.zeros(2), np.empty((3, MOVING))
        self.reset((0.0, 0.0, 0.0), seed=0)

    def reset(self, pose: tuple[float, float, float], *, seed: int) -> None:
        """Put the vehicle at rest at `pose`; how long it has driven stays as it is.

        Raises
        ------
        PlantError
            If the pose is not finite.
        """
        place = checked_pose(pose)
        rng = random_stream(self._seed, seed)
        self._variation[:] = self.vehicle.wheel_scatter * rng.standard_normal(2)
        self._counters[:] = rng.integers(FRAME_STEPS), 0
        hours = self._state[HOURS]
        self._state[:] = 0.0
        self._state[[X, Y, HEADING]] = place
        self._state[HOURS] = hours

    def advance(self, drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float]:
        """Hold the command for `dt` seconds; return the pose of the marker centroid (m, m, rad).

        Raises
        ------
        PlantError
            If a command is not a finite number, or `dt` is negative, not finite or over a day.
        """
        drive, front, _, dt = checked_advance(drive, front, rear, dt)
        return advance(self._constants, self._variation, self._state, self._counters, self._work, drive, front, dt)

    def true_state(self) -> dict[str, float]:
        """Return what no camera sees, for figures: the wheels' speeds [m/s] as the controller sees them."""
        return {"left_mps": float(self._state[LEFT]), "right_mps": float(self._state[RIGHT])}


def random_differential(seed: int) -> DifferentialVehicle:
    """Draw a differential vehicle round the default one.

    Uniform: assumed track 0.2…0.4 m, true one 1…1.25 times it; radii 0.93…1.05 with 1.5 % between left and right;
    controller 8…25 rad/s, damping 0.7…1, acceleration 1…6 m/s²; slip 0…0.4 s²/m²; markers ±6 mm along and across;
    droop 0…0.05 1/h; delay 0…5 frames.
    """
    rng = random_stream(0xD1FF, seed)

    def draw(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    track, radius = draw(0.2, 0.4), draw(0.93, 1.05)
    apart = draw(-0.0075, 0.0075)
    return replace(
        DifferentialVehicle(),
        assumed_track_m=track, true_track_m=track * draw(1.0, 1.25), left_radius=radius * (1.0 + apart),
        right_radius=radius * (1.0 - apart), natural_frequency_rad_per_s=draw(8.0, 25.0), damping_ratio=draw(0.7, 1.0),
        acceleration_mps2=draw(1.0, 6.0), slip_s2_per_m2=draw(0.0, 0.4), marker_forward_m=0.05 + draw(-0.006, 0.006),
        marker_left_m=draw(-0.006, 0.006),
        droop_per_hour=draw(0.0, 0.05), delay_frames=float(rng.integers(6)),
    )  # fmt: skip
