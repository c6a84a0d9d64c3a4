"""The commands of chapter 8: pulses and driving time, assumed where the thesis does not say."""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

from agvbench.model import thesis_vehicle
from agvbench.thesis.prediction.assumptions import (
    Assumptions,
    CalibratedDrive,
    CalibratedSteering,
    TrueDrive,
    WholeDegrees,
)
from agvbench.thesis.prediction.trajectories import ThesisTrajectory, wanted_angles
from agvbench.thesis.refits.drive import PARTIAL_US, cubic_map, dead_band_map
from agvbench.thesis.refits.steering import published_lines, unrounded_lines
from agvbench.thesis.tables import GEOMETRY, NEUTRAL_US
from agvbench.vehicle.kinematics import body_motion

FULL_SPEED_MPS = 0.32
NOMINAL_US_PER_DEG = 600.0 / 45.0


class CommandedDrive(NamedTuple):
    """One drive's command: three pulses [µs], held for `duration_s`, then stop."""

    drive_us: float
    front_us: float
    rear_us: float
    duration_s: float


@cache
def true_speed(drive_us: float, kind: TrueDrive = "measured") -> float:
    """Return the speed [m/s] at a drive pulse and 1500 µs of steering: the shipped vehicle's, from table 7.4.

    ``"dead_band"`` takes the dead band with saturation fitted to the same table; at full command the two agree.
    """
    return float(thesis_vehicle().speed(drive_us) if kind == "measured" else dead_band_map()(drive_us))


def commanded(trajectory: ThesisTrajectory, condition: str, assumed: Assumptions) -> CommandedDrive:
    """Return what the vehicle was commanded on `trajectory` under `condition`."""
    angles = wanted_angles(trajectory.side, assumed.steering, GEOMETRY)
    if condition == "uncalibrated":
        drive_us, speed = _uncalibrated_drive(trajectory.drive, assumed.nominal_speed)
        front_us, rear_us = (_nominal_pulse(a, assumed.whole_degrees) for a in angles)
    else:
        drive_us, speed = _calibrated_drive(
            trajectory.drive, trajectory.half_speed, assumed.calibrated_drive, assumed.true_drive
        )
        front_us, rear_us = _calibrated_pulses(angles, assumed.calibrated_steering)
    return CommandedDrive(drive_us, front_us, rear_us, _duration(trajectory, angles, abs(speed), assumed.duration))


@cache
def _duration(trajectory: ThesisTrajectory, angles: tuple[float, float], speed_mps: float, duration: str) -> float:
    if duration == "path" or not trajectory.is_turn:
        return trajectory.path_m / speed_mps
    _, _, yaw_rate = body_motion(*angles, speed_mps, speed_mps, GEOMETRY)
    return abs(trajectory.heading_rad / float(yaw_rate))


def _uncalibrated_drive(direction: int, nominal_speed: str) -> tuple[float, float]:
    """Return full command and its nominal speed: ±0.32 m/s (table 6.2), or table 7.4's."""
    drive_us = NEUTRAL_US - direction * 600.0
    return drive_us, FULL_SPEED_MPS if nominal_speed == "0.32" else true_speed(drive_us)


def _nominal_pulse(angle_rad: float, whole_degrees: WholeDegrees) -> float:
    """Return the nominal map's pulse: 45° per 600 µs about 1500, falling for a left turn."""
    return NEUTRAL_US - NOMINAL_US_PER_DEG * cut_to_degrees(math.degrees(angle_rad), whole_degrees)


def cut_to_degrees(angle_deg: float, how: WholeDegrees) -> float:
    """Return the steering angle that survives a command in whole degrees.

    >>> [cut_to_degrees(10.6, how) for how in ("none", "rounded", "toward_straight", "servo_floor")]
    [10.6, 11.0, 10.0, 11.0]
    >>> cut_to_degrees(-10.6, "servo_floor")
    -10.0
    """
    if how == "none":
        return angle_deg
    if how == "rounded":
        return math.copysign(math.floor(abs(angle_deg) + 0.5), angle_deg)
    if how == "toward_straight":
        return float(math.trunc(angle_deg))
    # The servo's own degrees count from 45 (left) over 90 (straight) to 135 (right), and lose their fraction.
    return 90.0 - math.floor(90.0 - angle_deg)


@cache
def _calibrated_pulses(angles: tuple[float, float], how: CalibratedSteering) -> tuple[float, float]:
    front, rear = published_lines() if how == "published" else unrounded_lines()
    return float(front.inverse(angles[0])), float(rear.inverse(angles[1]))


@cache
def _calibrated_drive(
    direction: int, half_speed: bool, how: CalibratedDrive, true_drive: TrueDrive
) -> tuple[float, float]:
    """Return the drive pulse and the speed from which the driving time was computed."""
    wanted = direction * FULL_SPEED_MPS * (0.5 if half_speed else 1.0)
    cubic = cubic_map()
    if how == "end_of_range":
        end_us = PARTIAL_US[0] if direction > 0 else PARTIAL_US[1]
        drive_us = float(thesis_vehicle().drive.inverse(wanted)) if half_speed else end_us
        return drive_us, float(cubic(drive_us))
    drive_us = float(cubic.inverse(wanted))
    return drive_us, wanted if how == "cubic" else true_speed(drive_us, true_drive)
