"""Discrepancy terms of axle angles that depend on what was steered before."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from agvbench.diagnosis.terms.base import DiscrepancyTerm, decayed
from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import (
    CREEP_AT,
    FRONT,
    FRONT_AIM,
    FRONT_BEFORE,
    FRONT_COMMAND,
    FRONT_CREEP,
    FRONT_HELD,
    FRONT_KEPT,
    FRONT_KEPT_AT,
    FRONT_LAGS,
    FRONT_LAGS_AT,
    FRONT_REVERSAL,
    FRONT_SLIPPED,
    REAR,
    REAR_AIM,
    REAR_BEFORE,
    REAR_COMMAND,
    REAR_CREEP,
    REAR_HELD,
    REAR_KEPT,
    REAR_KEPT_AT,
    REAR_LAGS,
    REAR_LAGS_AT,
    REAR_REVERSAL,
    REAR_SLIPPED,
    TIME,
)
from agvbench.model.compiled import compiled
from agvbench.types import Floats


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


@dataclass(frozen=True)
class SteeringDeadBand(DiscrepancyTerm):
    """Servos ignore a command within a dead band about the one that they obey, and go all the way beyond it.

    ``δ_map ← δ_map + share (δ_kept − δ_map)``, where δ_kept is the target under the command that is obeyed. With a
    ``share`` of 1 nothing of an ignored command is left. The likelihood is a step function of ``width``: its value is
    that of a grid.
    """

    name: ClassVar[str] = "steering_dead_band"
    stage: ClassVar[Stage] = Stage.SERVO
    covariates: ClassVar[tuple[str, ...]] = ("history", "curvature_per_m")
    through: ClassVar[str] = "steering"
    needs_steered_axles: ClassVar[bool] = True

    share: float = parameter(unit="–", low=-0.5, high=1.2, scale=0.2)
    width: float = parameter(unit="command", low=0.0, high=1000.0, scale=1.0, is_discrete=True)

    @staticmethod
    def aim(state: Floats, share: float, width: float) -> None:
        """Keep the targets of commands within the dead band."""
        if share != 0.0:
            if abs(state[FRONT_COMMAND] - state[FRONT_KEPT_AT]) > width:
                state[FRONT_KEPT], state[FRONT_KEPT_AT] = state[FRONT_AIM], state[FRONT_COMMAND]
            if abs(state[REAR_COMMAND] - state[REAR_KEPT_AT]) > width:
                state[REAR_KEPT], state[REAR_KEPT_AT] = state[REAR_AIM], state[REAR_COMMAND]
            state[FRONT_AIM] += share * (state[FRONT_KEPT] - state[FRONT_AIM])
            state[REAR_AIM] += share * (state[REAR_KEPT] - state[REAR_AIM])


@compiled(inline=True)
def side_after(side: float, distance: float, above: float, below: float) -> float:
    """Return the side to which a linkage slipped last, at a command at this `distance` from neutral."""
    return 1.0 if distance > above else (-1.0 if distance < -below else side)


@dataclass(frozen=True)
class SteeringSlip(DiscrepancyTerm):
    """A linkage slips at commands far from neutral, and remains displaced until it slips to the other side.

    ``δ_map ← δ_map − slip s``, where s = 1 after a command ``above`` neutral by more than this, −1 after one ``below``
    it by more than that, and 0 before. A servo saver slips. The likelihood is a step function of both distances: their
    values are those of a grid. Both axles have the same parameters.
    """

    name: ClassVar[str] = "steering_slip"
    stage: ClassVar[Stage] = Stage.SERVO
    covariates: ClassVar[tuple[str, ...]] = ("history",)
    through: ClassVar[str] = "steering"
    needs_steered_axles: ClassVar[bool] = True

    slip_rad: float = parameter(unit="rad", low=-0.3, high=0.3, scale=0.02)
    above: float = parameter(unit="command", low=0.0, high=1000.0, scale=1.0, is_discrete=True)
    below: float = parameter(unit="command", low=0.0, high=1000.0, scale=1.0, is_discrete=True)

    @staticmethod
    def aim(state: Floats, slip_rad: float, above: float, below: float) -> None:
        """Displace both targets by the slip."""
        if slip_rad != 0.0:
            state[FRONT_SLIPPED] = side_after(state[FRONT_SLIPPED], state[FRONT_COMMAND], above, below)
            state[REAR_SLIPPED] = side_after(state[REAR_SLIPPED], state[REAR_COMMAND], above, below)
            state[FRONT_AIM] -= slip_rad * state[FRONT_SLIPPED]
            state[REAR_AIM] -= slip_rad * state[REAR_SLIPPED]
