# mypy: warn-return-any=False
"""Gaps of first order while one command is in force, in closed form: a ramp, and a decay after it.

An actuator obeys v̇ = (aim − v) / lag within ± rate: its gap |aim − v| falls at that rate while the limit is active, and
decays from there on.
"""

from __future__ import annotations

import math

from agvbench.model.compiled import compiled
from agvbench.types import Floats

# A gap: initial size, rate of the ramp, time constant of the decay, end of the ramp with the gap left there, settling
# time. Times are seconds since the command took effect.
_GAP, _RATE, _LAG, _RAMPED_S, _RAMPED_GAP, GAP_SETTLED_S = range(6)
GAP_SIZE = 6

# Below this gap [rad, m/s] an actuator counts as settled.
_SETTLED = 1e-7
# Length of a step in time constants: the first one, and its growth per time constant.
_FIRST_STEP, _STEP_GROWTH = 0.7, 0.25
# The longest step while a servo or the drive ramps, and the shortest step of all [s].
RAMP_STEP_S, SHORTEST_S = 0.1, 1e-6
# How close to a kink, or to the next command, counts as there [s].
TOGETHER = 1e-12


@compiled(inner=True)
def plan_gap(plan: Floats, at: int, gap: float, lag: float, rate: float) -> None:
    """Compute how an unsigned `gap` closes."""
    plan[at + _GAP], plan[at + _LAG], plan[at + _RATE] = gap, lag, rate
    plan[at + _RAMPED_S], plan[at + _RAMPED_GAP] = 0.0, gap if lag > 0.0 else 0.0
    if rate < math.inf and gap > rate * lag:
        plan[at + _RAMPED_S], plan[at + _RAMPED_GAP] = gap / rate - lag, rate * lag
    ramped, left = plan[at + _RAMPED_S], plan[at + _RAMPED_GAP]
    plan[at + GAP_SETTLED_S] = ramped + lag * math.log(left / _SETTLED) if left > _SETTLED else ramped


@compiled(inner=True)
def gap_at(plan: Floats, at: int, tau: float) -> float:
    """Return the rest of a gap `tau` seconds after it began to close."""
    if tau >= plan[at + GAP_SETTLED_S]:
        return 0.0
    if tau < plan[at + _RAMPED_S]:
        return plan[at + _GAP] - plan[at + _RATE] * tau
    return plan[at + _RAMPED_GAP] * math.exp((plan[at + _RAMPED_S] - tau) / plan[at + _LAG])


@compiled(inner=True)
def reaches_s(plan: Floats, at: int, gap: float) -> float:
    """Return the time at which the rest of a gap is `gap`; ∞ if it never is."""
    if gap <= _SETTLED or gap >= plan[at + _GAP]:
        return math.inf
    if gap >= plan[at + _RAMPED_GAP]:
        return (plan[at + _GAP] - gap) / plan[at + _RATE]
    return plan[at + _RAMPED_S] + plan[at + _LAG] * math.log(plan[at + _RAMPED_GAP] / gap)


@compiled(inner=True)
def kink_s(plan: Floats, at: int) -> float:
    """Return the end of a ramp; ∞ if there is none."""
    return plan[at + _RAMPED_S] if plan[at + _RAMPED_S] > 0.0 else math.inf


@compiled(inner=True)
def _within(longest: float, lag: float, since: float) -> float:
    if lag <= 0.0:
        return longest
    return min(longest, max(SHORTEST_S, _FIRST_STEP * lag + _STEP_GROWTH * max(0.0, since)))


@compiled(inner=True)
def within_gap(plan: Floats, at: int, tau: float, longest: float) -> float:
    """Return the length of a step from `tau` within which the motion is smooth."""
    if tau < plan[at + _RAMPED_S]:
        return min(longest, RAMP_STEP_S)
    if tau < plan[at + GAP_SETTLED_S]:
        return _within(longest, plan[at + _LAG], tau - plan[at + _RAMPED_S])
    return longest
