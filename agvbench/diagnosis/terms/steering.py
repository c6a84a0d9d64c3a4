"""Discrepancy terms of the axle angles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from agvbench.diagnosis.terms.base import DiscrepancyTerm, decayed
from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import (
    CREEP_AT,
    DRIVE_START,
    FRONT,
    FRONT_AIM,
    FRONT_BEFORE,
    FRONT_CREEP,
    FRONT_HELD,
    FRONT_LAGS,
    FRONT_LAGS_AT,
    FRONT_REVERSAL,
    REAR,
    REAR_AIM,
    REAR_BEFORE,
    REAR_CREEP,
    REAR_HELD,
    REAR_LAGS,
    REAR_LAGS_AT,
    REAR_REVERSAL,
    SPEED,
    SPEED_AIM,
    TIME,
)
from agvbench.model.compiled import compiled
from agvbench.types import Floats

# At this speed [m/s] the maps hold: a gain that grows with the speed from rest on would change them.
TYPICAL_MPS = 0.2


@dataclass(frozen=True)
class SteeringByDirection(DiscrepancyTerm):
    """The offset of the axle angles has the sign of the driving direction: ``δ ← δ ± angle``."""

    name: ClassVar[str] = "steering_by_direction"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("direction",)
    through: ClassVar[str] = "steering"

    front_rad: float = parameter(unit="rad", low=-0.3, high=0.3, scale=0.02)
    rear_rad: float = parameter(unit="rad", low=-0.3, high=0.3, scale=0.02)

    @staticmethod
    def steer(state: Floats, front_rad: float, rear_rad: float) -> None:
        """Turn each axle with the sign of the speed."""
        if state[SPEED] != 0.0:
            state[FRONT] += math.copysign(front_rad, front_rad * state[SPEED])
            state[REAR] += math.copysign(rear_rad, rear_rad * state[SPEED])


@dataclass(frozen=True)
class SteeringBySpeed(DiscrepancyTerm):
    """The axles turn more or less the faster the vehicle drives: ``δ ← δ (1 + gain (|v| − 0.2 m/s))``.

    Each axle has a gain of its own: a linkage yields, or a caster turns it back.
    """

    name: ClassVar[str] = "steering_by_speed"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("speed_mps", "curvature_per_m")
    through: ClassVar[str] = "steering"
    needs_steered_axles: ClassVar[bool] = True

    front_s_per_m: float = parameter(unit="s/m", low=-3.0, high=3.0, scale=0.2)
    rear_s_per_m: float = parameter(unit="s/m", low=-3.0, high=3.0, scale=0.2)

    @staticmethod
    def steer(state: Floats, front_s_per_m: float, rear_s_per_m: float) -> None:
        """Scale each angle by the speed."""
        faster = abs(state[SPEED]) - TYPICAL_MPS
        state[FRONT] *= 1.0 + front_s_per_m * faster
        state[REAR] *= 1.0 + rear_s_per_m * faster


@dataclass(frozen=True)
class SteeringAtStart(DiscrepancyTerm):
    """The axles turn less while the drive starts: ``δ ← δ (1 − loss |v_map| e^(−(t − t₀)/T))``.

    The drive starts from rest at t₀. A motor that starts draws a current in proportion to the speed that is commanded;
    servos with the same supply are then weak.
    """

    name: ClassVar[str] = "steering_at_start"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("time_in_run_s", "history")
    through: ClassVar[str] = "steering"
    longest_step_s: ClassVar[float] = 0.1

    loss_s_per_m: float = parameter(unit="s/m", low=-3.0, high=3.0, scale=0.1)
    # A shorter one would be the lag of a servo, a longer one a gain that the maps absorb.
    time_constant_s: float = parameter(unit="s", low=0.15, high=60.0, scale=1.0, null=1.0)

    @staticmethod
    def steer(state: Floats, loss_s_per_m: float, time_constant_s: float) -> None:
        """Scale both angles by the time since the drive started."""
        if loss_s_per_m != 0.0:
            since_s = max(state[TIME] - state[DRIVE_START], 0.0)
            loss = loss_s_per_m * abs(state[SPEED_AIM]) * math.exp(-since_s / time_constant_s)
            state[FRONT] *= 1.0 - loss
            state[REAR] *= 1.0 - loss


@dataclass(frozen=True)
class SteeringByHistory(DiscrepancyTerm):
    """Axles stop short of their target by shares of a change of angle, the same for both axles.

    ``share`` is of the change since the previous command, ``since_reversal`` of that since the axle last reversed, as
    in hysteresis of a gear. Few runs turn an axle back, and often only one of both: shares by axle would be poorly
    determined.
    """

    name: ClassVar[str] = "steering_by_history"
    stage: ClassVar[Stage] = Stage.SERVO
    covariates: ClassVar[tuple[str, ...]] = ("history", "curvature_per_m")
    through: ClassVar[str] = "steering"

    share: float = parameter(unit="–", low=-0.5, high=0.7, scale=0.05)
    since_reversal: float = parameter(unit="–", low=-0.5, high=0.7, scale=0.05)

    @staticmethod
    def aim(state: Floats, share: float, since_reversal: float) -> None:
        """Reduce the changes of both targets."""
        front, rear = state[FRONT_AIM], state[REAR_AIM]
        state[FRONT_AIM] -= share * (front - state[FRONT_BEFORE]) + since_reversal * (front - state[FRONT_REVERSAL])
        state[REAR_AIM] -= share * (rear - state[REAR_BEFORE]) + since_reversal * (rear - state[REAR_REVERSAL])


@compiled(inline=True)
def lags_after(lags: float, travel: float, reach_rad: float) -> float:
    """Return the share of the most by which an axle lags behind after a `travel` [rad] one way, of `lags` before it."""
    most = math.copysign(1.0, travel)
    return most + (lags - most) * math.exp(-abs(travel) / reach_rad)


@dataclass(frozen=True)
class SteeringByTravel(DiscrepancyTerm):
    """Axles lag behind their target by an amount that saturates with the travel: ``δ ← δ − h z``, |z| ≤ 1.

    ``dz = share (dδ − z |dδ|) / 2h`` is the equation of Dahl for friction beside an elastic linkage. Of a motion right
    after a reversal ``share`` is lost, and less and less of it later. Backlash loses all of it within the gap and none
    beyond: a share above a half would be a backlash in all but name. Both axles have the same parameters.
    """

    name: ClassVar[str] = "steering_by_travel"
    stage: ClassVar[Stage] = Stage.SERVO
    covariates: ClassVar[tuple[str, ...]] = ("history", "curvature_per_m")
    through: ClassVar[str] = "steering"
    form_of: ClassVar[frozenset[str]] = frozenset({"steering_backlash"})
    distinguished_by: ClassVar[str] = "runs whose steering turns back by less than the backlash while they drive"

    half_width_rad: float = parameter(unit="rad", low=0.0, high=0.3, scale=0.02)
    share: float = parameter(unit="–", low=0.0, high=0.5, scale=0.2)

    @staticmethod
    def aim(state: Floats, half_width_rad: float, share: float) -> None:
        """Reduce both targets by what the axles lag behind after their travel since the previous command."""
        if half_width_rad > 0.0 and share > 0.0:
            reach_rad = 2.0 * half_width_rad / share
            front, rear = state[FRONT_AIM], state[REAR_AIM]
            state[FRONT_LAGS] = lags_after(state[FRONT_LAGS], front - state[FRONT_LAGS_AT], reach_rad)
            state[REAR_LAGS] = lags_after(state[REAR_LAGS], rear - state[REAR_LAGS_AT], reach_rad)
            state[FRONT_LAGS_AT], state[REAR_LAGS_AT] = front, rear
            state[FRONT_AIM] -= half_width_rad * state[FRONT_LAGS]
            state[REAR_AIM] -= half_width_rad * state[REAR_LAGS]


@dataclass(frozen=True)
class SteeringCreep(DiscrepancyTerm):
    """Axles creep after a step: ``δ ← δ + gain (δ_map − z)``, where z follows the target, ``T ż = δ_map − z``.

    With a gain above 0 they go beyond their target at first and come back; below 0, a last part of the way takes long.
    Both axles have the same parameters. A visco-elastic linkage creeps (standard linear solid).
    """

    name: ClassVar[str] = "steering_creep"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("history", "time_in_run_s")
    through: ClassVar[str] = "steering"
    longest_step_s: ClassVar[float] = 0.1
    needs_steered_axles: ClassVar[bool] = True

    gain: float = parameter(unit="–", low=-0.7, high=0.7, scale=0.1)
    # A shorter one would be the lag of a servo, a longer one a gain that the maps absorb.
    time_constant_s: float = parameter(unit="s", low=0.15, high=20.0, scale=1.0, null=1.0)

    @staticmethod
    def aim(state: Floats, gain: float, time_constant_s: float) -> None:
        """Add the steps of both targets to the ways that are left."""
        if gain != 0.0:
            front, rear, since_s = state[FRONT_AIM], state[REAR_AIM], state[TIME] - state[CREEP_AT]
            state[FRONT_CREEP] = decayed(state[FRONT_CREEP], since_s, time_constant_s) + front - state[FRONT_HELD]
            state[REAR_CREEP] = decayed(state[REAR_CREEP], since_s, time_constant_s) + rear - state[REAR_HELD]
            state[FRONT_HELD], state[REAR_HELD], state[CREEP_AT] = front, rear, state[TIME]

    @staticmethod
    def steer(state: Floats, gain: float, time_constant_s: float) -> None:
        """Add a share of the ways that are left."""
        if gain != 0.0:
            since_s = state[TIME] - state[CREEP_AT]
            state[FRONT] += gain * decayed(state[FRONT_CREEP], since_s, time_constant_s)
            state[REAR] += gain * decayed(state[REAR_CREEP], since_s, time_constant_s)
