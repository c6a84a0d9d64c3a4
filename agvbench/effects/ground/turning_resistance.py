"""Dry resistance of the tyres to turning, against a controller of the yaw rate with integral action."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from agvbench.compiled import cached_njit
from agvbench.effects.base import Effect, Stage, parameter
from agvbench.effects.state import (
    FRONT,
    FRONT_AIM,
    MEASURED_WEIGHT,
    MEASURED_YAW_RATE,
    TIME,
    YAW_INTEGRAL,
    YAW_INTEGRAL_AT,
    YAW_TARGET,
)
from agvbench.types import Floats

_LEAST_VARIANCE = 1e-6


@cached_njit(nogil=True, error_model="numpy")
def integral_after(integral: float, target: float, friction: float, integral_time: float, elapsed: float) -> float:
    """Return the integral part `elapsed` seconds after it was `integral`, under a constant `target`, in closed form.

    While the vehicle stands it grows linearly, until it overcomes the friction. From then on it approaches the friction
    exponentially, and the yaw rate its target. From rest it never exceeds the friction, so that the vehicle never turns
    against its target.
    """
    if target == 0.0:
        return integral
    side = math.copysign(1.0, target)
    until_turning = side * friction - target - integral
    if side * until_turning > 0.0:
        turns_s = until_turning / target * integral_time
        if elapsed <= turns_s:
            return integral + target * elapsed / integral_time
        integral, elapsed = integral + until_turning, elapsed - turns_s
    return side * friction + (integral - side * friction) * math.exp(-elapsed / integral_time)


@cached_njit(nogil=True, error_model="numpy")
def likely_integral(integral: float, target: float, yaw_rate: float, weight: float, friction: float) -> float:
    """Return the integral part, given that which results from earlier commands and the measured yaw rate.

    The vehicle stands or turns to either side: that with the least sum of squares of both deviations. A measurement has
    the share `weight` (0…1) in a mean with the commands.
    """
    precision = weight / max(1.0 - weight, _LEAST_VARIANCE)
    demand = target + integral
    best = min(max(demand, -friction), friction)
    least = (best - demand) ** 2 + precision * yaw_rate**2
    for k in range(2):
        side = 2.0 * k - 1.0
        turning = (demand + precision * (yaw_rate + side * friction)) / (1.0 + precision)
        turning = side * max(side * turning, friction)
        cost = (turning - demand) ** 2 + precision * (turning - side * friction - yaw_rate) ** 2
        if cost < least:
            best, least = turning, cost
    return min(max(best - target, -friction), friction)


@cached_njit(nogil=True, error_model="numpy")
def integral_now(state: Floats, friction: float, integral_time: float) -> float:
    """Return the integral part at the time of the state."""
    elapsed = state[TIME] - state[YAW_INTEGRAL_AT]
    return integral_after(state[YAW_INTEGRAL], state[YAW_TARGET], friction, integral_time, elapsed)


@dataclass(frozen=True)
class TurningResistance(Effect):
    """Tyres that scrub resist turning, and a controller with integral action overcomes this after a time.

    ``ω = ω_map + J ∓ friction``, or 0 while ``|ω_map + J| ≤ friction``, with the integral part
    ``J̇ = (ω_map − ω) / integral_time``. The yaw rate grows slowly and falls at once.
    """

    name: ClassVar[str] = "turning_resistance"
    stage: ClassVar[Stage] = Stage.WHEELS
    relaxes: ClassVar[str] = "the yaw rate follows its command at once (7.3, for a differential vehicle)"
    reference: ClassVar[str] = (
        "moment of turning resistance (Wong 2008, Theory of Ground Vehicles, chapter 6) against a "
        "proportional-integral controller (Armstrong-Hélouvry, Dupont and Canudas de Wit 1994, Automatica 30)"
    )
    limits: ClassVar[str] = (
        "neglects inertia and viscous resistance; without integral action it is a dead band, which the map absorbs; "
        "turns to one side alone resemble steering_lag"
    )
    remedy: ClassVar[str] = (
        "tune the speed controllers of the wheels, feed the resistance forward, or plan fewer and longer turns"
    )
    longest_step_s: ClassVar[float] = 0.1
    needs_differential: ClassVar[bool] = True

    friction_radps: float = parameter(unit="rad/s", low=0.0, high=5.0, scale=0.2)
    integral_time_s: float = parameter(unit="s", low=0.05, high=1000.0, scale=3.0, null=math.inf)

    @staticmethod
    def beside(outputs: Floats, at_neutral: float, *parameters: float) -> Floats:
        """Return the map of a controller, in proportion: its largest output overcomes the friction."""
        fastest = np.max(np.abs(outputs), initial=0.0)
        return np.asarray(outputs * (1.0 + parameters[0] / fastest) if fastest > 0.0 else outputs)

    @staticmethod
    def aim(state: Floats, friction_radps: float, integral_time_s: float) -> None:
        """Advance the integral part to the time of a command."""
        if friction_radps != 0.0:
            state[YAW_INTEGRAL] = integral_now(state, friction_radps, integral_time_s)
            state[YAW_INTEGRAL_AT], state[YAW_TARGET] = state[TIME], state[FRONT_AIM]

    @staticmethod
    def adopt(state: Floats, friction_radps: float, integral_time_s: float) -> None:
        """Let the integral part be what the measured yaw rate makes likely."""
        if friction_radps != 0.0:
            integral = integral_now(state, friction_radps, integral_time_s)
            state[YAW_INTEGRAL] = likely_integral(
                integral, state[FRONT], state[MEASURED_YAW_RATE], state[MEASURED_WEIGHT], friction_radps
            )
            state[YAW_INTEGRAL_AT] = state[TIME]

    @staticmethod
    def steer(state: Floats, friction_radps: float, integral_time_s: float) -> None:
        """Turn at what the demand exceeds the friction by."""
        if friction_radps != 0.0:
            demand = state[FRONT] + integral_now(state, friction_radps, integral_time_s)
            state[FRONT] = math.copysign(max(abs(demand) - friction_radps, 0.0), demand)
