"""Discrepancy terms of the axle angles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from agvbench.diagnosis.terms.base import DiscrepancyTerm
from agvbench.effects.base import Stage, parameter
from agvbench.effects.state import (
    DRIVE_START,
    FRONT,
    FRONT_AIM,
    HEADING,
    REAR,
    REAR_AIM,
    SPEED,
    SPEED_AIM,
    START_HEADING,
    TIME,
)
from agvbench.model.compiled import compiled
from agvbench.types import Floats

# At this speed [m/s] the maps hold: a gain that grows with the speed from rest on would change them.
TYPICAL_MPS = 0.2
# Feedback that would destabilise the vehicle ends here.
_LEAST_FEEDBACK = 0.2


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
class SteeringByVelocity(DiscrepancyTerm):
    """The offset of the axle angles is proportional to the commanded velocity: ``δ ← δ + slope v_map``.

    A part of the drive command reaches the servos, or the torque of the drive steers.
    """

    name: ClassVar[str] = "steering_by_velocity"
    stage: ClassVar[Stage] = Stage.SERVO
    covariates: ClassVar[tuple[str, ...]] = ("direction", "speed_mps")
    through: ClassVar[str] = "steering"
    needs_steered_axles: ClassVar[bool] = True

    front_rad_s_per_m: float = parameter(unit="rad s/m", low=-1.0, high=1.0, scale=0.05)
    rear_rad_s_per_m: float = parameter(unit="rad s/m", low=-1.0, high=1.0, scale=0.05)

    @staticmethod
    def aim(state: Floats, front_rad_s_per_m: float, rear_rad_s_per_m: float) -> None:
        """Displace both targets."""
        state[FRONT_AIM] += front_rad_s_per_m * state[SPEED_AIM]
        state[REAR_AIM] += rear_rad_s_per_m * state[SPEED_AIM]


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
    for_windows: ClassVar[bool] = False
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
class SteeringByTurnedHeading(DiscrepancyTerm):
    """The axles turn with the heading that the vehicle has turned in the run: ``δ ← δ + slope (ψ − ψ_start)``.

    A cable to the vehicle winds up, or a gyroscope holds a heading.
    """

    name: ClassVar[str] = "steering_by_turned_heading"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("turned_rad",)
    through: ClassVar[str] = "steering"
    for_windows: ClassVar[bool] = False
    longest_step_s: ClassVar[float] = 0.1
    needs_steered_axles: ClassVar[bool] = True

    front: float = parameter(unit="–", low=-1.0, high=1.0, scale=0.02)
    rear: float = parameter(unit="–", low=-1.0, high=1.0, scale=0.02)

    @staticmethod
    def steer(state: Floats, front: float, rear: float) -> None:
        """Turn both axles."""
        turned = state[HEADING] - state[START_HEADING]
        state[FRONT] += front * turned
        state[REAR] += rear * turned


@compiled(inline=True)
def relative_tangent(front_rad: float, rear_rad: float) -> float:
    """Return tan δ_f − tan δ_r: the curvature of the path of a vehicle, times the distance between its axles."""
    return math.tan(front_rad) - math.tan(rear_rad)


@dataclass(frozen=True)
class SteeringByYawRate(DiscrepancyTerm):
    """The axles turn against the yaw rate: ``δ ← δ − gain v (tan δ_f − tan δ_r)``, the feedback of a gyroscope.

    The last factors are the yaw rate times the distance between the axles. Forward the vehicle turns less, and backward
    more.
    """

    name: ClassVar[str] = "steering_by_yaw_rate"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("direction", "curvature_per_m", "speed_mps")
    through: ClassVar[str] = "steering"
    needs_steered_axles: ClassVar[bool] = True

    front_s_per_m: float = parameter(unit="s/m", low=-1.0, high=1.0, scale=0.05)
    rear_s_per_m: float = parameter(unit="s/m", low=-1.0, high=1.0, scale=0.05)

    @staticmethod
    def steer(state: Floats, front_s_per_m: float, rear_s_per_m: float) -> None:
        """Turn both axles, with the yaw rate that results."""
        if front_s_per_m != 0.0 or rear_s_per_m != 0.0:
            fed_back = 1.0 + (front_s_per_m - rear_s_per_m) * state[SPEED]
            turns = state[SPEED] * relative_tangent(state[FRONT], state[REAR]) / max(fed_back, _LEAST_FEEDBACK)
            state[FRONT] -= front_s_per_m * turns
            state[REAR] -= rear_s_per_m * turns


@dataclass(frozen=True)
class SteeringBySideForce(DiscrepancyTerm):
    """The axles yield to the side force: ``δ ← δ + most tanh(a / reach)`` with ``a = v² (tan δ_f − tan δ_r)``.

    That is the lateral acceleration times the distance between the axles. An axle with play turns through all of it at
    a small force; an elastic one yields in proportion, which a large ``reach`` describes.
    """

    name: ClassVar[str] = "steering_by_side_force"
    stage: ClassVar[Stage] = Stage.WHEELS
    covariates: ClassVar[tuple[str, ...]] = ("curvature_per_m", "speed_mps")
    through: ClassVar[str] = "steering"
    needs_steered_axles: ClassVar[bool] = True

    front_rad: float = parameter(unit="rad", low=-0.5, high=0.5, scale=0.02)
    rear_rad: float = parameter(unit="rad", low=-0.5, high=0.5, scale=0.02)
    reach: float = parameter(unit="m²/s²", low=0.003, high=3.0, scale=0.05, null=0.05)

    @staticmethod
    def steer(state: Floats, front_rad: float, rear_rad: float, reach: float) -> None:
        """Turn both axles to the side of the force, or against it."""
        if front_rad != 0.0 or rear_rad != 0.0:
            force = state[SPEED] * state[SPEED] * relative_tangent(state[FRONT], state[REAR])
            share = math.tanh(force / reach)
            state[FRONT] += front_rad * share
            state[REAR] += rear_rad * share
