# mypy: warn-return-any=False
"""Axles behind servos of second order, with a backlash: the times at which they stop and move on.

From one reversal of the servo to the next its motion is monotone. The axle stands until the servo takes it along, which
is bisected. An array, the *plan*, holds the servo's response (`servos`) and the axle.
"""

from __future__ import annotations

import math

from agvbench.model.compiled import compiled
from agvbench.model.simulation.actuators.gaps import RAMP_STEP_S, SHORTEST_S, TOGETHER
from agvbench.model.simulation.actuators.servos import (
    INERT,
    SETTLED_S,
    TURNS_EVERY_S,
    TURNS_S,
    WAY_SIZE,
    longest_step,
    way_at,
)
from agvbench.types import Floats

# After the response: aim, half the backlash, and the position of the axle at the last reversal; then the next reversal,
# and when the servo takes the axle along before it. Times are seconds since the command took effect.
AIM, HALF_BACKLASH, AXLE, _TURN_S, _TAKES_S = range(WAY_SIZE, WAY_SIZE + 5)
FOLLOWER_SIZE = WAY_SIZE + 5

# Halvings of an interval in search of a kink.
_BISECTIONS = 45


@compiled(inner=True)
def follow(plan: Floats, servo: int, axle: float, position: float) -> float:
    """Return where an axle comes to rest whose servo has moved to `position` without a reversal."""
    half = plan[servo + HALF_BACKLASH]
    return min(max(axle, position - half), position + half)


@compiled(inner=True)
def way_position(plan: Floats, servo: int, order: int, tau: float) -> float:
    """Return the position of a servo of second order."""
    return plan[servo + AIM] - way_at(plan, servo, order, tau)[0]


@compiled(inner=True)
def plan_follower(plan: Floats, servo: int, order: int) -> None:
    """Compute when the axle is taken along; the response, the aim, half the backlash and the axle are in the plan."""
    plan[servo + _TURN_S] = plan[servo + TURNS_S]
    if plan[servo + HALF_BACKLASH] > 0.0:
        _plan_one_way(plan, servo, order, 0.0)


@compiled(inner=True)
def _plan_one_way(plan: Floats, servo: int, order: int, begin: float) -> None:
    """Compute when a servo of second order, on its way from `begin` to the next reversal, takes its axle along.

    An oscillation decays: if a way between two reversals leaves the axle where it is, all later ones do.
    """
    axle, half = plan[servo + AXLE], plan[servo + HALF_BACKLASH]
    low, high = begin, min(plan[servo + _TURN_S], plan[servo + SETTLED_S])
    moved = way_position(plan, servo, order, high) - axle
    plan[servo + _TAKES_S] = math.inf
    if abs(moved) <= half or low >= high:
        if begin > 0.0 and order == INERT:
            plan[servo + _TURN_S] = math.inf
        return
    side = math.copysign(1.0, moved)
    for _ in range(_BISECTIONS if side * (way_position(plan, servo, order, low) - axle) < half else 0):
        middle = 0.5 * (low + high)
        if side * (way_position(plan, servo, order, middle) - axle) < half:
            low = middle
        else:
            high = middle
    plan[servo + _TAKES_S] = high if low > begin else begin


@compiled(inner=True)
def way_axle(plan: Floats, servo: int, order: int, tau: float) -> float:
    """Return the position of the axle behind a servo of second order, with its reversals."""
    axle = plan[servo + AXLE]
    if plan[servo + HALF_BACKLASH] > 0.0:
        turns = plan[servo + _TURN_S]
        while turns < min(tau, plan[servo + SETTLED_S]):
            axle = follow(plan, servo, axle, way_position(plan, servo, order, turns))
            turns += plan[servo + TURNS_EVERY_S]
    return follow(plan, servo, axle, way_position(plan, servo, order, tau))


@compiled(inner=True)
def within_way(plan: Floats, servo: int, order: int, tau: float, longest: float) -> float:
    """Return the length of a step from `tau`, at most `longest`, within which the motion of the axle is smooth."""
    if tau >= plan[servo + SETTLED_S]:
        return longest
    if plan[servo + HALF_BACKLASH] > 0.0:
        _pass_turns(plan, servo, order, tau)
        if plan[servo + _TURN_S] - tau > TOGETHER:
            longest = min(longest, plan[servo + _TURN_S] - tau)
        if plan[servo + _TAKES_S] - tau > TOGETHER:  # the axle stands
            return min(longest, plan[servo + _TAKES_S] - tau)
    return max(SHORTEST_S, longest_step(plan, servo, order, tau, min(longest, RAMP_STEP_S)))


@compiled(inner=True)
def _pass_turns(plan: Floats, servo: int, order: int, tau: float) -> None:
    """Advance the axle behind a servo of second order to the last reversal before `tau`."""
    while plan[servo + _TURN_S] <= min(tau, plan[servo + SETTLED_S]) + TOGETHER:
        turn = plan[servo + _TURN_S]
        plan[servo + AXLE] = follow(plan, servo, plan[servo + AXLE], way_position(plan, servo, order, turn))
        plan[servo + _TURN_S] = turn + plan[servo + TURNS_EVERY_S]
        _plan_one_way(plan, servo, order, turn)
