"""Command mapping: from a curvature and a share of full drive to a command, by the nominal model."""

from __future__ import annotations

import math

import numpy as np

from agvbench.errors import PlanError
from agvbench.model import VehicleModel
from agvbench.planning.steering import centre_forward
from agvbench.planning.trajectories.segments import Steering
from agvbench.running.command_shares import Shares
from agvbench.types import Command
from agvbench.vehicle.channels import Channel
from agvbench.vehicle.maps import StaticMap

_LARGEST_RAD = math.radians(40.0)
_PLANNED, _STEERED = 0.4, 0.95
"""Of the angle at which an axle stops: what a return path is planned with, and what following it may take."""


class CommandMapping:
    """Steers a vehicle, by its nominal model, about a centre abeam of its guided point, with every steered axle.

    ``forward_m`` is how far the guided point lies ahead of the markers' centroid.
    """

    def __init__(self, model: VehicleModel) -> None:
        self.model = model
        self.shares = Shares.of_model(model)
        self.forward_m = centre_forward(_mode(model), model.geometry)
        self._levers = (model.geometry.front_axle_m - self.forward_m, -model.geometry.rear_axle_m - self.forward_m)
        self._most_per_m = self._curvature_at(_STEERED)
        if not self._most_per_m > 0.0:
            raise PlanError(
                "a vehicle that cannot steer both ways cannot drive itself back", where=f"vehicle {model.name}",
                value="a radius of inf m", remedy="bench with --place operator, or fix its steering maps",
            )  # fmt: skip

    @property
    def radius_m(self) -> float:
        """The radius [m] to plan with."""
        return 1.0 / self._curvature_at(_PLANNED)

    def _curvature_at(self, share: float) -> float:
        """Return the curvature [1/m] at which the first axle is at `share` of its largest angle."""
        limits = []
        for lever, static_map in zip(self._levers, (self.model.front, self.model.rear), strict=True):
            if abs(lever) > 1e-9:
                limits.append(math.tan(share * min(_LARGEST_RAD, *map(abs, static_map.output_range))) / abs(lever))
        return min(limits)

    def curvature(self, wanted_per_m: float) -> float:
        """Return the curvature [1/m] nearest to `wanted_per_m` that can be steered."""
        return min(self._most_per_m, max(-self._most_per_m, wanted_per_m))

    def command(self, share: float, curvature_per_m: float) -> Command:
        """Return the command of a share of full drive, negative backward, and a curvature [1/m], left positive."""
        front, rear = (
            _steered(static_map, math.atan(lever * curvature_per_m), channel)
            for lever, static_map, channel in zip(
                self._levers,
                (self.model.front, self.model.rear),
                (self.model.channels.front, self.model.channels.rear),
                strict=True,
            )
        )
        return Command(self.neutral.drive + share * self.shares.drive, front, rear)

    @property
    def neutral(self) -> Command:
        """The command at which the vehicle stands."""
        return self.model.neutral


def _mode(model: VehicleModel) -> Steering:
    front, rear = (low < high for low, high in (model.front.output_range, model.rear.output_range))
    if not front and not rear:
        raise PlanError("a vehicle that does not steer cannot drive back to its start", where=model.name)
    return "abeam" if front and rear else "front" if front else "rear"


def _steered(static_map: StaticMap, angle_rad: float, channel: Channel) -> float:
    low, high = static_map.output_range
    if low == high:
        return channel.neutral
    command = float(static_map.inverse(np.clip(angle_rad, low, high)))
    return min(channel.high, max(channel.low, command))
