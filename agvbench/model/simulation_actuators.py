# mypy: warn-return-any=False
"""Servos and drive while one command is in force, in closed form.

A servo obeys δ̇ = (aim − δ) / lag within ± rate: it ramps as long as the lag asks for more than the rate, and then its
gap decays. Its way is monotone, so the axle behind it, with play, is known from where it stood. The drive obeys
v̇ = (aim − v) / lag; where it has to reverse it brakes to rest first. All of this is kept as a *plan*, an array.
"""

from __future__ import annotations

import math

from agvbench.effects.state import (
    ACCELERATE_LAG,
    BRAKE_LAG,
    FRONT,
    FRONT_AIM,
    PLAY,
    REAR,
    REAR_AIM,
    SPEED,
    SPEED_AIM,
    STEERING_LAG,
    STEERING_RATE,
)
from agvbench.model.compiled import compiled
from agvbench.types import Floats

# A plan: for each servo (from `SERVOS` on), then for the drive. Moments are seconds since the command took effect.
_AIM, _DIRECTION, _GAP, _RAMPED_S, _RAMPED_GAP, _SETTLED_S, _AXLE = range(7)
_FRONT, _REAR, _DRIVE = 0, 7, 14
_FIRST_GAP, _FIRST_LAG, _RESTS_S, _SECOND_LAG, _DRIVE_SETTLED_S = range(14, 19)
_LAG, _RATE, _HALF_PLAY, _SPEED_AIM = range(19, 23)
_EVENTS = 23
_EVENT_COUNT = 9
PLAN_SIZE = _EVENTS + _EVENT_COUNT

# What is left of a gap [rad, m/s] when it counts as settled.
_SETTLED = 1e-9
# How long a step may be in time constants: at first, and per time constant that has passed.
_FIRST_STEP, _STEP_GROWTH = 0.5, 0.15
# The longest step while a servo ramps, and how close to a kink counts as there [s].
_RAMP_STEP_S, _TOGETHER = 0.05, 1e-12
# Numbers that ask for shorter steps are nonsense, but must not hang the loop [s].
_SHORTEST_S = 1e-6


@compiled(inner=True)
def _gap(plan: Floats, servo: int, tau: float) -> float:
    """Return how far a servo still has to go, `tau` seconds after the command took effect."""
    if tau >= plan[servo + _SETTLED_S]:
        return 0.0
    if tau < plan[servo + _RAMPED_S]:
        return plan[servo + _GAP] - plan[_RATE] * tau
    return plan[servo + _RAMPED_GAP] * math.exp((plan[servo + _RAMPED_S] - tau) / plan[_LAG])


@compiled(inner=True)
def _reaches(plan: Floats, servo: int, gap: float) -> float:
    """Return when a servo has `gap` left to go; ∞ if it never has."""
    if gap <= _SETTLED or gap >= plan[servo + _GAP]:
        return math.inf
    if gap >= plan[servo + _RAMPED_GAP]:
        return (plan[servo + _GAP] - gap) / plan[_RATE]
    return plan[servo + _RAMPED_S] + plan[_LAG] * math.log(plan[servo + _RAMPED_GAP] / gap)


@compiled(inner=True)
def _plan_servo(plan: Floats, servo: int, position: float, axle: float, aim: float) -> None:
    gap, lag, rate = abs(aim - position), plan[_LAG], plan[_RATE]
    plan[servo + _AIM], plan[servo + _DIRECTION], plan[servo + _GAP] = aim, math.copysign(1.0, aim - position), gap
    plan[servo + _RAMPED_S], plan[servo + _RAMPED_GAP] = 0.0, gap if lag > 0.0 else 0.0
    if rate < math.inf and gap > rate * lag:
        plan[servo + _RAMPED_S], plan[servo + _RAMPED_GAP] = gap / rate - lag, rate * lag
    ramped, left = plan[servo + _RAMPED_S], plan[servo + _RAMPED_GAP]
    plan[servo + _SETTLED_S] = ramped + lag * math.log(left / _SETTLED) if left > _SETTLED else ramped
    plan[servo + _AXLE] = axle
    events, direction, half = _EVENTS + 4 * (servo > 0), plan[servo + _DIRECTION], plan[_HALF_PLAY]
    plan[events] = ramped if ramped > 0.0 else math.inf
    plan[events + 1] = plan[servo + _SETTLED_S]
    # The axle begins to follow; the axle passes the middle.
    plan[events + 2] = _reaches(plan, servo, direction * (aim - axle) - half) if half > 0.0 else math.inf
    plan[events + 3] = _reaches(plan, servo, direction * aim - half)


@compiled(inner=True)
def _plan_drive(plan: Floats, speed: float, aim: float, accelerate: float, brake: float) -> None:
    plan[_SPEED_AIM], plan[_FIRST_GAP], plan[_RESTS_S] = aim, speed - aim, math.inf
    plan[_FIRST_LAG] = accelerate if abs(aim) > abs(speed) else brake
    plan[_SECOND_LAG] = accelerate
    gap, begin = abs(speed - aim), 0.0
    lag = plan[_FIRST_LAG]
    if speed * aim < 0.0:
        plan[_FIRST_LAG] = brake
        plan[_RESTS_S] = begin = brake * math.log((aim - speed) / aim)
        gap, lag = abs(aim), accelerate
    plan[_DRIVE_SETTLED_S] = begin + lag * math.log(gap / _SETTLED) if gap > _SETTLED and lag > 0.0 else begin
    plan[_EVENTS + 8] = plan[_RESTS_S]


@compiled(inner=True)
def plan_command(plan: Floats, state: Floats, servos: Floats) -> None:
    """Plan how servos and drive go from where they are to the aims in `state`.

    `servos` has shape (5,): positions of the servos front and rear, of their axles, and the speed of the drive.
    """
    plan[_LAG], plan[_RATE], plan[_HALF_PLAY] = state[STEERING_LAG], state[STEERING_RATE], 0.5 * state[PLAY]
    _plan_servo(plan, _FRONT, servos[0], servos[2], state[FRONT_AIM])
    _plan_servo(plan, _REAR, servos[1], servos[3], state[REAR_AIM])
    _plan_drive(plan, servos[4], state[SPEED_AIM], state[ACCELERATE_LAG], state[BRAKE_LAG])


@compiled(inner=True)
def _axle(plan: Floats, servo: int, position: float) -> float:
    half = plan[_HALF_PLAY]
    return min(max(plan[servo + _AXLE], position - half), position + half)


@compiled(inner=True)
def _position(plan: Floats, servo: int, tau: float) -> float:
    return plan[servo + _AIM] - plan[servo + _DIRECTION] * _gap(plan, servo, tau)


@compiled(inner=True)
def _speed(plan: Floats, tau: float) -> float:
    aim = plan[_SPEED_AIM]
    if tau < plan[_RESTS_S]:
        if tau >= plan[_DRIVE_SETTLED_S] and plan[_RESTS_S] == math.inf:
            return aim
        return aim + plan[_FIRST_GAP] * math.exp(-tau / plan[_FIRST_LAG])
    if tau >= plan[_DRIVE_SETTLED_S]:
        return aim
    return -aim * math.expm1((plan[_RESTS_S] - tau) / plan[_SECOND_LAG])


@compiled(inner=True)
def actuate(plan: Floats, tau: float, state: Floats) -> None:
    """Put the axles' angles and the drive's speed into `state`, `tau` seconds after the command took effect."""
    state[FRONT] = _axle(plan, _FRONT, _position(plan, _FRONT, tau))
    state[REAR] = _axle(plan, _REAR, _position(plan, _REAR, tau))
    state[SPEED] = _speed(plan, tau)


@compiled(inner=True)
def leave_command(plan: Floats, tau: float, servos: Floats) -> None:
    """Put positions and speed at `tau`, where another command takes effect, into `servos`."""
    servos[0], servos[1] = _position(plan, _FRONT, tau), _position(plan, _REAR, tau)
    servos[2], servos[3] = _axle(plan, _FRONT, servos[0]), _axle(plan, _REAR, servos[1])
    servos[4] = _speed(plan, tau)


@compiled(inner=True)
def _within(longest: float, lag: float, since: float) -> float:
    if lag <= 0.0:
        return longest
    return min(longest, max(_SHORTEST_S, _FIRST_STEP * lag + _STEP_GROWTH * max(0.0, since)))


@compiled(inner=True)
def step_length(plan: Floats, tau: float, longest: float) -> float:
    """Return how long a step from `tau` may be: to the next kink at most, and short while a lag is under way."""
    step = longest
    for servo in (_FRONT, _REAR):
        if tau < plan[servo + _RAMPED_S]:
            step = min(step, _RAMP_STEP_S)
        elif tau < plan[servo + _SETTLED_S]:
            step = _within(step, plan[_LAG], tau - plan[servo + _RAMPED_S])
    if tau < plan[_DRIVE_SETTLED_S]:
        rests = plan[_RESTS_S]
        step = _within(step, plan[_FIRST_LAG], tau) if tau < rests else _within(step, plan[_SECOND_LAG], tau - rests)
    for i in range(_EVENT_COUNT):
        to_event = plan[_EVENTS + i] - tau
        if _TOGETHER < to_event < step:
            step = to_event
    return step
