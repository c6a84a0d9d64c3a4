"""A motion of the vehicle, in metres and radians, and the commands of a vehicle model for it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from agvbench.errors import VehicleError
from agvbench.model import VehicleModel
from agvbench.planning.legs import as_mounted
from agvbench.planning.planner import command_range
from agvbench.planning.steering import centre_forward
from agvbench.planning.trajectories.segments import Steering
from agvbench.types import Command
from agvbench.vehicle.channels import Role
from agvbench.vehicle.kinematics import axle_angles, body_velocity, wheel_speed


@dataclass(frozen=True)
class Motion:
    """What a controller asks of the vehicle.

    The *reference point* lies on the centre line, abeam of the centre of rotation: it moves along the heading. It is
    the rear axle of a vehicle that steers in front, the axle of a differential one, and the marker centroid with
    ``abeam`` steering.

    Parameters
    ----------
    speed_mps
        Forward speed of the reference point [m/s], negative backward; 0 stops the drive and sets the steering.
    curvature_per_m
        Heading change per metre that the reference point moves *forward* [1/m], left positive.
    crab_rad
        Angle between heading and direction of motion of the reference point [rad]; a differential vehicle ignores it.
    """

    speed_mps: float
    curvature_per_m: float = 0.0
    crab_rad: float = 0.0

    @property
    def is_finite(self) -> bool:
        """Whether all three numbers are finite."""
        return all(map(math.isfinite, (self.speed_mps, self.curvature_per_m, self.crab_rad)))


class Actuation:
    """Turns motions into commands of `model`, and back, where the vehicle is steered in the mode `steering`."""

    def __init__(self, model: VehicleModel, steering: Steering) -> None:
        self.model = model
        geometry = model.geometry
        mode: Steering = "front" if geometry.is_differential else "abeam" if steering == "crab" else steering
        self.ahead_m = centre_forward(mode, geometry)
        """How far the reference point lies ahead of the marker centroid [m]."""

    def command(self, motion: Motion) -> Command:
        """Return the command of a finite `motion`, clipped to what the vehicle reaches.

        A drive of which only full speed is known drives at full speed.
        """
        front, rear, speed = self._actuators(motion)
        command = Command(self._inverse("drive", speed), self._inverse("front", front), self._inverse("rear", rear))
        return self.clipped(self.model.stop_after(command) if motion.speed_mps == 0.0 else command)

    def _actuators(self, motion: Motion) -> tuple[float, float, float]:
        """Return front and rear angle [rad] (yaw rate [rad/s] and 0), and the speed of the drive [m/s]."""
        geometry = self.model.geometry
        if geometry.is_differential:
            speed = _clip(motion.speed_mps, self.model.drive.output_range)
            return speed * motion.curvature_per_m, 0.0, speed
        left = math.tan(motion.crab_rad) - self.ahead_m * motion.curvature_per_m
        front, rear = (float(angle) for angle in axle_angles(1.0, left, motion.curvature_per_m, geometry))
        front, rear = as_mounted(front, rear, self.model)
        front, rear = _clip(front, self.model.front.output_range), _clip(rear, self.model.rear.output_range)
        return front, rear, float(wheel_speed(motion.speed_mps, front, rear, geometry))

    def _inverse(self, role: Role, wanted: float) -> float:
        """Return the command of a channel whose output comes next to the `wanted` one."""
        channel = getattr(self.model, role)
        low, high = channel.output_range
        reached = _clip(wanted, (low, high))
        neutral: float = getattr(self.model.neutral, role)
        if float(channel(neutral)) == reached:
            return neutral
        try:
            return float(channel.inverse(reached))
        except VehicleError:
            return float(channel.inverse(high if wanted > 0.0 else low))

    def clipped(self, command: Command) -> Command:
        """Return a finite `command` clipped to the range of each channel, of its unit and of its map.

        Where a wheel of a differential vehicle saturates, both slow down, and the curvature is kept.
        """
        own = Command(*(self._clipped(role, getattr(command, role)) for role in Command._fields))
        return self.model.channels.limited(own)

    def _clipped(self, role: str, command: float) -> float:
        if command == getattr(self.model.neutral, role):
            return command  # a stop is a stop, even where no command near neutral was calibrated
        allowed = command_range(getattr(self.model.channels, role))
        known = getattr(self.model, role).command_range
        return _clip(command, (max(allowed[0], known[0]), min(allowed[1], known[1])))

    def motion(self, command: Command) -> Motion:
        """Return the motion that the model's static maps give `command`; a turn on the spot is none."""
        model, geometry = self.model, self.model.geometry
        front, rear = (float(angle) for angle in model.axle_angles(command.front, command.rear))
        speed = 0.0 if command.drive == model.neutral.drive else float(model.speed(command.drive))
        if geometry.is_differential:
            return Motion(speed, front / speed if speed else 0.0)
        forward, left, turn = (float(value) for value in body_velocity(front, rear, 1.0, 1.0, geometry))
        curvature = turn / forward
        return Motion(speed * forward, curvature, math.atan(left / forward + self.ahead_m * curvature))


def _clip(value: float, ends: tuple[float, float]) -> float:
    return float(np.clip(value, *ends))
