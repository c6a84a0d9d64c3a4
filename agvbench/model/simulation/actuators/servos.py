# mypy: warn-return-any=False
"""Servos of second order while one command is in force, in closed form: with inertia, or with limited acceleration.

A servo with inertia obeys τ² δ̈ + lag δ̇ = aim − δ, a linear equation. A servo with limited acceleration moves to its aim
as fast as its rate and acceleration allow, and stops there: three parabolas. Either may have an initial rate away from
its aim; a servo with inertia may also oscillate about its aim. The times of reversal are known in closed form.
"""

from __future__ import annotations

import math

from agvbench.model.compiled import compiled
from agvbench.types import Floats

FIRST_ORDER, LIMITED, INERT = range(3)

# A response: initial gap and rate, settling time, first time of reversal and the interval of further ones; then for
# inertia the decay, the frequency squared (negative: overdamped) and the lag squared, for limits the ends of the first
# two parabolas, the rate between them and the acceleration.
GAP, GAP_RATE, SETTLED_S, TURNS_S, TURNS_EVERY_S, _DECAY, _SQUARE, _TAU = range(8)
SPED_S, CRUISED_S, _CRUISE, _ACCELERATION = range(5, 9)
WAY_SIZE = 9
# A plan begins with the homogeneous solutions computed last: decay, frequency squared and time, then cosine and
# sine. Servos and drive of a differential vehicle have the same, and each is needed for the gap and for its rate.
_OF_DECAY, _OF_SQUARE, _AT_S, _COSINE, _SINE, SOLUTIONS_SIZE = range(6)

# Below this gap [rad] a servo counts as settled.
_SETTLED = 1e-7
# Length of a step in time constants: the first one, and its growth per time constant.
_FIRST_STEP, _STEP_GROWTH = 0.7, 0.25
# After this many time constants nothing is left of a decay.
_DECAYED = 16.0
_LONG = 20.0
# The search for a time: its precision [s], and its most iterations.
_EXACT_S, _MOST_ITERATIONS = 1e-13, 60


@compiled(inner=True)
def plan_inert(plan: Floats, way: int, gap: float, gap_rate: float, lag: float, tau: float) -> None:
    """Compute the response of a servo with inertia; its `gap` is signed."""
    decay, square = 0.5 * lag / (tau * tau), 1.0 / (tau * tau) - 0.25 * lag * lag / tau**4
    plan[way + GAP], plan[way + GAP_RATE] = gap, gap_rate
    plan[way + _DECAY], plan[way + _SQUARE], plan[way + _TAU] = decay, square, tau
    slowest = decay
    if square < 0.0:
        slowest = 1.0 / (tau * tau * (decay + math.sqrt(-square)))
    amplitude = abs(gap) + _LONG * tau * (abs(gap_rate) + decay * abs(gap))
    plan[way + SETTLED_S] = 0.0
    if amplitude > _SETTLED:
        plan[way + SETTLED_S] = math.log(amplitude / _SETTLED) / slowest if slowest > 0.0 else math.inf
    _plan_turns(plan, way)


@compiled(inner=True)
def _plan_turns(plan: Floats, way: int) -> None:
    """Compute the times of reversal, at which the rate c g′ − s (decay g′ + g / τ²) is zero."""
    tau, square = plan[way + _TAU], plan[way + _SQUARE]
    rate = plan[way + GAP_RATE]
    against = plan[way + _DECAY] * rate + plan[way + GAP] / (tau * tau)
    plan[way + TURNS_S] = _first_root(rate, against, square)
    plan[way + TURNS_EVERY_S] = math.pi / math.sqrt(square) if square > 0.0 else math.inf


@compiled(inner=True)
def _first_root(cosine: float, sine: float, square: float) -> float:
    """Return the first t > 0 at which `cosine` c(t) = `sine` s(t), in the notation of `_plan_turns`; ∞ if none is."""
    frequency = math.sqrt(abs(square))
    if square > 0.0:
        angle = math.atan2(cosine * frequency, sine)
        return (angle if angle > 0.0 else angle + math.pi) / frequency
    if sine == 0.0 or cosine / sine <= 0.0 or frequency * cosine / sine >= 1.0:
        return math.inf
    share = cosine / sine
    return math.atanh(frequency * share) / frequency if frequency > 0.0 else share


@compiled(inner=True)
def closes_s(plan: Floats, way: int) -> float:
    """Return when the gap of a response with inertia is first zero, c g + s (g′ + decay g) = 0; ∞ if it never is."""
    gap = plan[way + GAP]
    return _first_root(gap, -plan[way + GAP_RATE] - plan[way + _DECAY] * gap, plan[way + _SQUARE])


@compiled(inner=True)
def crosses_s(plan: Floats, way: int, level: float) -> float:
    """Return when a response with inertia first has the gap `level`, between its initial gap and zero; ∞ if not.

    There is no closed form: Newton's method, which falls back to bisection, finds it before the reversal behind it.
    """
    beyond = plan[way + GAP] > level
    if level == 0.0 or (level > 0.0) != beyond:
        return math.inf
    low, high = 0.0, min(plan[way + TURNS_S], plan[way + SETTLED_S])
    if (_inert(plan, way, high)[0] > level) == beyond:
        high = min(plan[way + TURNS_S] + plan[way + TURNS_EVERY_S], plan[way + SETTLED_S])
    if high == math.inf or (_inert(plan, way, high)[0] > level) == beyond:
        return math.inf
    at = 0.5 * (low + high)
    for _ in range(_MOST_ITERATIONS):
        gap, rate = _inert(plan, way, at)
        if (gap > level) == beyond:
            low = at
        else:
            high = at
        move = (level - gap) / rate  # infinite without a rate
        if abs(move) < _EXACT_S or high - low < _EXACT_S:
            break
        at += move
        if not low < at < high:
            at = 0.5 * (low + high)
    return at


@compiled(inner=True)
def _inert(plan: Floats, way: int, t: float) -> tuple[float, float]:
    decay, square, tau = plan[way + _DECAY], plan[way + _SQUARE], plan[way + _TAU]
    if t != plan[_AT_S] or decay != plan[_OF_DECAY] or square != plan[_OF_SQUARE]:
        _solve(plan, decay, square, tau, t)
    c, s = plan[_COSINE], plan[_SINE]
    gap, rate = plan[way + GAP], plan[way + GAP_RATE]
    return c * gap + s * (rate + decay * gap), c * rate - s * (decay * rate + gap / (tau * tau))


@compiled(inner=True)
def _solve(plan: Floats, decay: float, square: float, tau: float, t: float) -> None:
    """Compute the homogeneous solutions exp(−decay t) cos(ω t) and exp(−decay t) sin(ω t) / ω."""
    frequency = math.sqrt(abs(square))
    if square >= 0.0:
        left = math.exp(-decay * t)
        c = left * math.cos(frequency * t)
        s = left * math.sin(frequency * t) / frequency if frequency > 0.0 else left * t
    else:
        left = math.exp(-t / (tau * tau * (decay + frequency)))
        lost = math.expm1(-2.0 * frequency * t)
        c, s = 0.5 * left * (2.0 + lost), -0.5 * left * lost / frequency
    plan[_OF_DECAY], plan[_OF_SQUARE], plan[_AT_S], plan[_COSINE], plan[_SINE] = decay, square, t, c, s


@compiled(inner=True)
def plan_limited(plan: Floats, way: int, gap: float, gap_rate: float, rate: float, acceleration: float) -> None:
    """Compute the response of a servo with limited rate and acceleration; its `gap` is signed."""
    plan[way + GAP], plan[way + GAP_RATE] = gap, gap_rate
    plan[way + TURNS_S] = plan[way + TURNS_EVERY_S] = math.inf
    # It moves towards the gap that remains after braking to rest.
    stopped = gap + 0.5 * gap_rate * abs(gap_rate) / acceleration
    towards = math.copysign(1.0, stopped)
    coming = -towards * gap_rate
    fastest = max(coming, 0.0, min(rate, math.sqrt(max(0.0, acceleration * towards * gap + 0.5 * coming * coming))))
    speeding = (fastest - coming) / acceleration
    ways = 0.5 * (coming + fastest) * speeding + 0.5 * fastest * fastest / acceleration
    cruising = max(0.0, towards * gap - ways) / fastest if fastest > 0.0 else 0.0
    plan[way + SPED_S], plan[way + CRUISED_S] = speeding, speeding + cruising
    plan[way + SETTLED_S] = speeding + cruising + fastest / acceleration
    plan[way + _CRUISE], plan[way + _ACCELERATION] = -towards * fastest, towards * acceleration
    if coming < 0.0:
        plan[way + TURNS_S] = -coming / acceleration


@compiled(inner=True)
def _limited(plan: Floats, way: int, t: float) -> tuple[float, float]:
    acceleration, cruise = plan[way + _ACCELERATION], plan[way + _CRUISE]
    if t < plan[way + SPED_S]:
        rate = plan[way + GAP_RATE] - acceleration * t
        return plan[way + GAP] + 0.5 * (plan[way + GAP_RATE] + rate) * t, rate
    left = plan[way + SETTLED_S] - t
    if t > plan[way + CRUISED_S]:
        return 0.5 * acceleration * left * left, -acceleration * left
    ending = plan[way + SETTLED_S] - plan[way + CRUISED_S]
    return -cruise * (left - 0.5 * ending), cruise


@compiled(inner=True)
def way_at(plan: Floats, way: int, order: int, t: float) -> tuple[float, float]:
    """Return the signed gap and its rate `t` seconds after the command took effect."""
    if t >= plan[way + SETTLED_S]:
        return 0.0, 0.0
    if order == INERT:
        return _inert(plan, way, t)
    return _limited(plan, way, t)


@compiled(inner=True)
def longest_step(plan: Floats, way: int, order: int, t: float, longest: float) -> float:
    """Return the length of a step from `t` within which the motion is smooth."""
    if t >= plan[way + SETTLED_S] or order == LIMITED:
        return longest
    tau, decay, square = plan[way + _TAU], plan[way + _DECAY], plan[way + _SQUARE]
    if square < 0.0:  # the fast decay first, and once nothing of it is left the slow one
        fast = decay + math.sqrt(-square)
        rate = fast if fast * t < _DECAYED else 1.0 / (tau * tau * fast)
        return min(longest, _FIRST_STEP / rate + _STEP_GROWTH * t)
    # The error of a step of 8th order grows with the amplitude of the oscillation, which decays.
    return min(longest, _FIRST_STEP * tau * math.exp(0.125 * decay * t))
