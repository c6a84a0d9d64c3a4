"""Predict an end pose of chapter 8 from the vehicle of chapters 6, 7, 8.1 and appendix B.

A command holds both axles and the drive constant, so the markers move on an arc whose shape depends on the
angles and whose length depends on the distance driven. That is a closed form: no integration in time is needed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

from agvbench.thesis.prediction.assumptions import Assumptions, Condition, Ramps
from agvbench.thesis.prediction.commands import CommandedDrive, commanded, true_speed
from agvbench.thesis.prediction.trajectories import EIGHT, ThesisTrajectory
from agvbench.thesis.refits.cornering import cornering_share, fitted_loss
from agvbench.thesis.refits.steering import true_maps, verification_maps
from agvbench.thesis.tables import GEOMETRY, NEUTRAL_US
from agvbench.types import Pose
from agvbench.vehicle.kinematics import body_motion

# 0.0 to 0.3 m/s in 0.294 s, and 0.32 to 0.02 m/s in 0.588 s.
ACCELERATION_MPS2 = 0.3 / 0.294
BRAKING_MPS2 = (0.32 - 0.02) / 0.588
# 8.1 sees "a small increase in velocity" after braking and gives no size: this is the most one would call small.
REBOUND_MPS = 0.1


def driven_distance(speed_mps: float, duration_s: float, ramps: Ramps) -> float:
    """Return the signed distance [m] driven at steady `speed_mps`, started and stopped as `ramps` says.

    Constant acceleration loses v²/2a at the start and constant braking adds v²/2b after the stop command; the
    rebound goes back by v_r²/b, up to its peak and down again at the rate of braking.

    >>> round(1000 * (driven_distance(0.32, 6.25, "accelerate_and_brake") - 2.0), 1)
    50.2
    """
    speed = abs(speed_mps)
    distance = speed * duration_s
    if ramps != "none":
        distance += 0.5 * speed**2 * (1.0 / BRAKING_MPS2 - 1.0 / ACCELERATION_MPS2)
    if ramps == "with_rebound":
        distance -= min(REBOUND_MPS, speed) ** 2 / BRAKING_MPS2
    return math.copysign(distance, speed_mps)


class SteadyMotion(NamedTuple):
    """How the markers move per metre that the same drive goes at 1500 µs of steering."""

    speed: float
    sideslip_rad: float
    yaw_per_m: float


def steady_motion(front_us: float, rear_us: float, condition: str, assumed: Assumptions) -> SteadyMotion:
    """Return the motion at two steering pulses."""
    before = condition == "uncalibrated" and assumed.uncalibrated_steering == "table_6_1"
    kind = "table_6_1" if before else assumed.true_steering
    return _steady_motion(front_us, rear_us, kind, assumed.cornering_loss == "appendix_b")


@cache
def _steady_motion(front_us: float, rear_us: float, kind: str, with_loss: bool) -> SteadyMotion:
    loss = fitted_loss() if with_loss else 0.0
    front, rear = _angles(kind, front_us, rear_us)
    speed, sideslip, yaw_rate = (float(x) for x in body_motion(front, rear, 1.0, 1.0, GEOMETRY))
    # Table 7.4 was driven at 1500 µs, so that is where the drive goes exactly as far as the table says.
    kept = float(cornering_share(front, rear, loss)) / neutral_share(kind, loss)
    return SteadyMotion(kept * speed, sideslip, kept * yaw_rate)


def _angles(kind: str, front_us: float, rear_us: float) -> tuple[float, float]:
    front, rear = verification_maps() if kind == "table_6_1" else true_maps(kind)
    return float(front(front_us)), float(rear(rear_us))


@cache
def neutral_share(kind: str, loss: float) -> float:
    """Return the share of the wheels' speed that is left at 1500 µs of steering, where neither axle is straight."""
    front, rear = _angles(kind, NEUTRAL_US, NEUTRAL_US)
    speed, _, _ = body_motion(front, rear, 1.0, 1.0, GEOMETRY)
    return float(speed) * float(cornering_share(front, rear, loss))


@dataclass(frozen=True)
class EndPosePrediction:
    """Where one drive ends: `end` in the start frame, Δs [mm] and heading change [deg], both signed."""

    trajectory: ThesisTrajectory
    condition: Condition
    command: CommandedDrive
    end: Pose
    turned_deg: float
    delta_s_mm: float


def predict(trajectory: ThesisTrajectory, condition: Condition, assumed: Assumptions) -> EndPosePrediction:
    """Return the predicted end of `trajectory` driven under `condition`."""
    command = commanded(trajectory, condition, assumed)
    drive = assumed.true_drive if condition == "calibrated" else "measured"
    motion = steady_motion(command.front_us, command.rear_us, condition, assumed)
    distance = driven_distance(true_speed(command.drive_us, drive), command.duration_s, assumed.ramps)
    end, turned = arc_end(distance * motion.speed, motion.sideslip_rad, distance * motion.yaw_per_m)
    delta_s = math.hypot(end.x_m, end.y_m) - trajectory.distance_m(assumed.turn_target)
    return EndPosePrediction(trajectory, condition, command, end, math.degrees(turned), 1000.0 * delta_s)


def arc_end(length_m: float, sideslip_rad: float, turned_rad: float) -> tuple[Pose, float]:
    """Return where an arc ends that starts at the origin with heading 0, and its heading change (not wrapped).

    Parameters
    ----------
    length_m
        Length of the path of the markers, negative backward.
    sideslip_rad
        Angle between heading and velocity (β of eq. 5.7).
    turned_rad
        Heading change over the whole arc.

    Examples
    --------
    >>> end, turned = arc_end(math.pi / 2, 0.0, math.pi / 2)
    >>> round(end.x_m, 12), round(end.y_m, 12)
    (1.0, 1.0)
    """
    half = 0.5 * turned_rad
    chord = length_m * (math.sin(half) / half if half else 1.0)
    direction = sideslip_rad + half
    return Pose(chord * math.cos(direction), chord * math.sin(direction), turned_rad), turned_rad


def driven(condition: Condition) -> tuple[ThesisTrajectory, ...]:
    """Return the trajectories that were driven under `condition`: uncalibrated knows no half speed."""
    return tuple(t for t in EIGHT if not (t.half_speed and condition == "uncalibrated"))


def predict_all(assumed: Assumptions, condition: Condition) -> list[EndPosePrediction]:
    """Return a prediction for every trajectory driven under `condition`, in order."""
    return [predict(trajectory, condition, assumed) for trajectory in driven(condition)]
