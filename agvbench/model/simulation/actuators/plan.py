# mypy: warn-return-any=False
"""Servos and drive while one command is in force, in closed form.

A servo obeys δ̇ = (aim − δ) / lag within ± rate (`gaps`). Its motion is monotone, so that the position of the axle
behind a backlash follows from the initial positions. Servos of second order are in `servos`, their axles in
`followers`. The drive obeys v̇ = (aim − v) / lag within limits of v̇, as a servo does; to reverse it brakes to rest
first. A drive with inertia, and an elastic drive train without power, obey an equation of second order in v, that of a
servo with inertia. An array, the *plan*, holds all of this.
"""

from __future__ import annotations

import math

from agvbench.effects.state import (
    ACCELERATE_LAG,
    ACCELERATION_LIMIT,
    BRAKE_LAG,
    BRAKING_LIMIT,
    COAST_RELAXATION,
    COAST_SPRING,
    DRIVE_INERTIA,
    FRONT,
    FRONT_AIM,
    FRONT_BACKLASH,
    REAR,
    REAR_AIM,
    REAR_BACKLASH,
    REAR_LAG_RATIO,
    RIGHT_RATE_RATIO,
    SPEED,
    SPEED_AIM,
    STEERING_ACCELERATION,
    STEERING_INERTIA,
    STEERING_LAG,
    STEERING_RATE,
)
from agvbench.model.compiled import compiled
from agvbench.model.simulation.actuators.followers import (
    AIM,
    AXLE,
    FOLLOWER_SIZE,
    HALF_BACKLASH,
    follow,
    plan_follower,
    way_axle,
    way_position,
    within_way,
)
from agvbench.model.simulation.actuators.gaps import (
    GAP_SETTLED_S,
    GAP_SIZE,
    SHORTEST_S,
    TOGETHER,
    gap_at,
    kink_s,
    plan_gap,
    reaches_s,
    within_gap,
)
from agvbench.model.simulation.actuators.servos import (
    CRUISED_S,
    FIRST_ORDER,
    INERT,
    LIMITED,
    SETTLED_S,
    SOLUTIONS_SIZE,
    SPED_S,
    TURNS_S,
    WAY_SIZE,
    closes_s,
    crosses_s,
    longest_step,
    plan_inert,
    plan_limited,
    way_at,
)
from agvbench.types import Floats

# A plan: for each servo, then for the drive. Times are seconds since the command took effect.
# A servo: a gap of first order, or a response of second order in the same place; then its axle, and the direction.
_DIRECTION = FOLLOWER_SIZE
_SERVO_SIZE = FOLLOWER_SIZE + 1
_FRONT = SOLUTIONS_SIZE
_REAR = _FRONT + _SERVO_SIZE
# The drive: its initial gap, and if it reverses the gap from rest.
_FIRST = _REAR + _SERVO_SIZE
_SECOND = _FIRST + GAP_SIZE
_SPEED_AIM, _SPEED_DIRECTION, _RESTS_S, _ORDER = range(_SECOND + GAP_SIZE, _SECOND + GAP_SIZE + 4)
# A drive of second order: which equation it has, and the response of its speed, whose gap is speed − aim. An elastic
# drive train has a windup and constants.
_DRIVE_ORDER, _WINDUP, _SPRING, _COAST_LAG, _RELAXATION = range(_ORDER + 1, _ORDER + 6)
_RESPONSE = _ORDER + 6
_EVENTS = _RESPONSE + WAY_SIZE
_EVENT_COUNT = 11
PLAN_SIZE = _EVENTS + _EVENT_COUNT
_PLAIN, _ELASTIC, _INERTIAL = range(3)

# Servos and drive between commands: positions of the servos and of their axles, the drive's speed and that which
# commands have made it recently, the servos' rates, the windup of the drive train [m], the mean square of the speed
# that commands have made recently, and the acceleration of a drive of second order.
SERVOS_SIZE = 11

# A smaller inertia oscillates faster than any camera resolves, and would need a step per oscillation.
_LEAST_INERTIA_S = 1e-3
# Time constant over inertia of a servo at a damping ratio of 0.2: position control that rings for longer is of no use.
_LEAST_DAMPED = 0.4


@compiled(inner=True)
def _plan_servo(plan: Floats, servo: int, position: float, axle: float, aim: float, lag: float, rate: float) -> None:
    plan_gap(plan, servo, abs(aim - position), lag, rate)
    plan[servo + AIM], plan[servo + _DIRECTION], plan[servo + AXLE] = aim, math.copysign(1.0, aim - position), axle
    events, direction, half = _EVENTS + 4 * (servo > _FRONT), plan[servo + _DIRECTION], plan[servo + HALF_BACKLASH]
    plan[events] = kink_s(plan, servo)
    plan[events + 1] = plan[servo + GAP_SETTLED_S]
    # The axle begins to follow; the axle passes the middle.
    plan[events + 2] = reaches_s(plan, servo, direction * (aim - axle) - half) if half > 0.0 else math.inf
    plan[events + 3] = reaches_s(plan, servo, direction * aim - half)


@compiled(inner=True)
def _plan_second_order(
    plan: Floats, servo: int, position: float, turning: float, axle: float, aim: float, ratio: float, state: Floats
) -> None:
    events = _EVENTS + 4 * (servo > _FRONT)
    plan[servo + AIM], plan[servo + AXLE] = aim, axle
    plan[events] = plan[events + 2] = math.inf
    if plan[_ORDER] == INERT:
        inertia = max(_LEAST_INERTIA_S, ratio * state[STEERING_INERTIA])
        lag = max(ratio * state[STEERING_LAG], _LEAST_DAMPED * inertia)
        plan_inert(plan, servo, aim - position, -turning, lag, inertia)
    else:
        limit = state[STEERING_ACCELERATION]
        plan_limited(plan, servo, aim - position, -turning, state[STEERING_RATE], limit)
        plan[events], plan[events + 2] = plan[servo + SPED_S], plan[servo + CRUISED_S]
    plan[events + 1], plan[events + 3] = plan[servo + SETTLED_S], plan[servo + TURNS_S]
    plan_follower(plan, servo, plan[_ORDER])


@compiled(inner=True)
def _plan_drive(
    plan: Floats, speed: float, aim: float, accelerate: float, brake: float, speeding: float, braking: float
) -> None:
    plan[_SPEED_AIM], plan[_SPEED_DIRECTION], plan[_RESTS_S] = aim, math.copysign(1.0, aim - speed), math.inf
    plan[_EVENTS + 10] = math.inf
    if abs(aim) > abs(speed) and speed * aim >= 0.0:
        plan_gap(plan, _FIRST, abs(aim - speed), accelerate, speeding)
    else:
        plan_gap(plan, _FIRST, abs(aim - speed), brake, braking)
    if speed * aim < 0.0:
        plan[_RESTS_S] = reaches_s(plan, _FIRST, abs(aim))
        plan_gap(plan, _SECOND, abs(aim), accelerate, speeding)
        plan[_EVENTS + 10] = plan[_RESTS_S] + kink_s(plan, _SECOND)
    plan[_EVENTS + 8], plan[_EVENTS + 9] = plan[_RESTS_S], kink_s(plan, _FIRST)


@compiled(inner=True)
def _plan_inertia(plan: Floats, speed: float, acceleration: float, lag: float, inertia: float) -> None:
    """Compute the response to τ² v̈ + lag v̇ = aim − v, in place of that of first order; it is linear, also at rest."""
    aim = plan[_SPEED_AIM]
    plan[_DRIVE_ORDER], plan[_RESTS_S], plan[_EVENTS + 10] = _INERTIAL, math.inf, math.inf
    plan_inert(plan, _RESPONSE, speed - aim, acceleration, lag, inertia)
    plan[_EVENTS + 8] = closes_s(plan, _RESPONSE) if aim == 0.0 else crosses_s(plan, _RESPONSE, -aim)
    plan[_EVENTS + 9] = plan[_RESPONSE + SETTLED_S]


@compiled(inner=True)
def _plan_coasting(plan: Floats, speed: float, windup: float, state: Floats) -> None:
    """Compute v̈ + (1 / T + 1 / R) v̇ + (1 / (T R) + k) v = 0 from v̇ = −v / T − k w and ẇ = v − w / R."""
    lag, spring, relaxation = state[BRAKE_LAG], state[COAST_SPRING], state[COAST_RELAXATION]
    plan[_WINDUP], plan[_RELAXATION], plan[_SPRING], plan[_COAST_LAG] = windup, relaxation, spring, lag
    if spring > 0.0 and lag > 0.0 and state[SPEED_AIM] == 0.0:
        plan[_DRIVE_ORDER] = _ELASTIC
        stiffness = 1.0 / (lag * relaxation) + spring
        damping = (1.0 / lag + 1.0 / relaxation) / stiffness
        plan_inert(plan, _RESPONSE, speed, -speed / lag - spring * windup, damping, 1.0 / math.sqrt(stiffness))
        plan[_EVENTS + 8], plan[_EVENTS + 9] = closes_s(plan, _RESPONSE), plan[_RESPONSE + SETTLED_S]


@compiled(inner=True)
def _windup(plan: Floats, tau: float) -> float:
    if plan[_DRIVE_ORDER] != _ELASTIC:  # it relaxes under power
        return plan[_WINDUP] * math.exp(-tau / plan[_RELAXATION]) if plan[_RELAXATION] < math.inf else 0.0
    speed, rate = way_at(plan, _RESPONSE, INERT, tau)
    return -(rate + speed / plan[_COAST_LAG]) / plan[_SPRING]


@compiled(inner=True)
def _rate(position: float, aim: float, state: Floats) -> float:
    """Return the rate limit of a servo on its way to the aim."""
    return state[STEERING_RATE] * (state[RIGHT_RATE_RATIO] if aim < position else 1.0)


@compiled(inner=True)
def plan_command(plan: Floats, state: Floats, servos: Floats) -> None:
    """Compute the plan of servos and drive from their states `servos` to the aims in `state`."""
    plan[_FRONT + HALF_BACKLASH], plan[_REAR + HALF_BACKLASH] = (
        0.5 * state[FRONT_BACKLASH],
        0.5 * state[REAR_BACKLASH],
    )
    plan[_ORDER] = FIRST_ORDER
    inert, ratio = state[STEERING_INERTIA] >= _LEAST_INERTIA_S, state[REAR_LAG_RATIO]
    if inert or state[STEERING_ACCELERATION] < math.inf:
        plan[_ORDER] = INERT if inert else LIMITED
        _plan_second_order(plan, _FRONT, servos[0], servos[6], servos[2], state[FRONT_AIM], 1.0, state)
        _plan_second_order(plan, _REAR, servos[1], servos[7], servos[3], state[REAR_AIM], ratio, state)
    else:
        lag = state[STEERING_LAG]
        front, rear = _rate(servos[0], state[FRONT_AIM], state), _rate(servos[1], state[REAR_AIM], state)
        _plan_servo(plan, _FRONT, servos[0], servos[2], state[FRONT_AIM], lag, front)
        _plan_servo(plan, _REAR, servos[1], servos[3], state[REAR_AIM], ratio * lag, rear)
    accelerate, brake = state[ACCELERATE_LAG], state[BRAKE_LAG]
    speeding, braking = state[ACCELERATION_LIMIT], state[BRAKING_LIMIT]
    _plan_drive(plan, servos[4], state[SPEED_AIM], accelerate, brake, speeding, braking)
    plan[_DRIVE_ORDER] = _PLAIN
    if state[DRIVE_INERTIA] >= _LEAST_INERTIA_S:
        grows = servos[4] * state[SPEED_AIM] >= 0.0 and abs(state[SPEED_AIM]) > abs(servos[4])
        _plan_inertia(plan, servos[4], servos[10], accelerate if grows else brake, state[DRIVE_INERTIA])
    _plan_coasting(plan, servos[4], servos[8], state)


@compiled(inner=True)
def _position(plan: Floats, servo: int, tau: float) -> float:
    return plan[servo + AIM] - plan[servo + _DIRECTION] * gap_at(plan, servo, tau)


@compiled(inner=True)
def _speed(plan: Floats, tau: float) -> float:
    aim, direction = plan[_SPEED_AIM], plan[_SPEED_DIRECTION]
    if tau < plan[_RESTS_S]:
        return aim - direction * gap_at(plan, _FIRST, tau)
    return aim - direction * gap_at(plan, _SECOND, tau - plan[_RESTS_S])


@compiled(inner=True)
def speed_at(plan: Floats, tau: float) -> float:
    """Return the drive's speed, `tau` seconds after the command took effect."""
    if plan[_DRIVE_ORDER] == _PLAIN:
        return _speed(plan, tau)
    return plan[_SPEED_AIM] + way_at(plan, _RESPONSE, INERT, tau)[0]


@compiled(inner=True)
def actuate(plan: Floats, tau: float, state: Floats) -> None:
    """Put the axles' angles and the drive's speed into `state`, `tau` seconds after the command took effect."""
    state[FRONT] = follow(plan, _FRONT, plan[_FRONT + AXLE], _position(plan, _FRONT, tau))
    state[REAR] = follow(plan, _REAR, plan[_REAR + AXLE], _position(plan, _REAR, tau))
    state[SPEED] = _speed(plan, tau)


@compiled(inner=True)
def actuate_any_order(plan: Floats, tau: float, state: Floats) -> None:
    """Do as `actuate`, also for actuators of second order; separate, because branches would cost the others a tenth."""
    order = plan[_ORDER]
    if order == FIRST_ORDER:
        actuate(plan, tau, state)
    else:
        state[FRONT], state[REAR] = way_axle(plan, _FRONT, order, tau), way_axle(plan, _REAR, order, tau)
    state[SPEED] = speed_at(plan, tau)


@compiled(inner=True)
def leave_command(plan: Floats, tau: float, servos: Floats) -> None:
    """Put positions, rates and speed at `tau`, where another command takes effect, into `servos`."""
    servos[4], servos[8] = speed_at(plan, tau), _windup(plan, tau)
    servos[10] = 0.0 if plan[_DRIVE_ORDER] == _PLAIN else way_at(plan, _RESPONSE, INERT, tau)[1]
    order = plan[_ORDER]
    if order == FIRST_ORDER:
        servos[0], servos[1] = _position(plan, _FRONT, tau), _position(plan, _REAR, tau)
        servos[2] = follow(plan, _FRONT, plan[_FRONT + AXLE], servos[0])
        servos[3] = follow(plan, _REAR, plan[_REAR + AXLE], servos[1])
        return
    servos[0], servos[1] = way_position(plan, _FRONT, order, tau), way_position(plan, _REAR, order, tau)
    servos[2], servos[3] = way_axle(plan, _FRONT, order, tau), way_axle(plan, _REAR, order, tau)
    servos[6], servos[7] = -way_at(plan, _FRONT, order, tau)[1], -way_at(plan, _REAR, order, tau)[1]


@compiled(inner=True)
def step_length(plan: Floats, tau: float, longest: float) -> float:
    """Return the length of a step from `tau`: at most to the next kink, and short while a lag is active."""
    order = plan[_ORDER]
    if order == FIRST_ORDER:
        step = within_gap(plan, _REAR, tau, within_gap(plan, _FRONT, tau, longest))
    else:
        step = within_way(plan, _REAR, order, tau, within_way(plan, _FRONT, order, tau, longest))
    if plan[_DRIVE_ORDER] != _PLAIN:
        step = max(SHORTEST_S, longest_step(plan, _RESPONSE, INERT, tau, step))
    elif tau >= plan[_RESTS_S]:
        step = within_gap(plan, _SECOND, tau - plan[_RESTS_S], step)
    else:
        step = within_gap(plan, _FIRST, tau, step)
    for i in range(_EVENT_COUNT):
        to_event = plan[_EVENTS + i] - tau
        if TOGETHER < to_event < step:
            step = to_event
    return step
