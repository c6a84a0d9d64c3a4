"""The eight trajectories of section 8.2, and the axle angles that each way of steering asks for."""

from __future__ import annotations

import math
from dataclasses import dataclass

from agvbench.thesis.prediction.assumptions import Steering, TurnTarget
from agvbench.vehicle.geometry import Geometry

RADIUS_M = 1.0
STRAIGHT_M = 2.0


@dataclass(frozen=True)
class ThesisTrajectory:
    """One of the eight: `drive` is +1 forward or −1 backward, `side` +1 left, −1 right or 0 straight."""

    number: int
    drive: int
    side: int
    half_speed: bool

    @property
    def is_turn(self) -> bool:
        """Whether it is one of the quarter turns 5–8."""
        return self.side != 0

    @property
    def path_m(self) -> float:
        """Length of the path [m]: 2 m, or a quarter of a circle of radius 1 m."""
        return RADIUS_M * math.pi / 2.0 if self.is_turn else STRAIGHT_M

    @property
    def heading_rad(self) -> float:
        """Target heading change [rad]: left forward and right backward turn counter-clockwise."""
        return self.side * self.drive * math.pi / 2.0

    def distance_m(self, turn_target: TurnTarget = "sqrt_2") -> float:
        """Return the target distance between start and end [m]."""
        if not self.is_turn:
            return STRAIGHT_M
        return math.sqrt(2.0) * RADIUS_M if turn_target == "sqrt_2" else 1.41


EIGHT = tuple(
    ThesisTrajectory(*row)
    for row in (
        (1, 1, 0, False),
        (2, -1, 0, False),
        (3, 1, 0, True),
        (4, -1, 0, True),
        (5, 1, 1, False),
        (6, 1, -1, False),
        (7, -1, 1, False),
        (8, -1, -1, False),
    )
)


def wanted_angles(side: int, steering: Steering, geometry: Geometry) -> tuple[float, float]:
    """Return (front, rear) axle angles [rad] for a turn of radius 1 m to `side`; (0, 0) for a straight.

    ``abeam`` measures the radius to the markers' centroid, ``front`` and ``rear`` to the axle that stays straight,
    ``opposite`` to the point midway between the axles.
    """
    lf, lr, wheelbase = geometry.front_axle_m, geometry.rear_axle_m, geometry.wheelbase_m
    lever = {
        "abeam": (lf, -lr),
        "front": (wheelbase, 0.0),
        "rear": (0.0, -wheelbase),
        "opposite": (wheelbase / 2.0, -wheelbase / 2.0),
    }[steering]
    return math.atan(side * lever[0] / RADIUS_M), math.atan(side * lever[1] / RADIUS_M)
