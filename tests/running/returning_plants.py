"""Plants that say where they truly are, and plants that do not do what they are told: for tests of the way back."""

from __future__ import annotations

import math

from agvbench.simulator import differential_plant, make_plant, random_differential_plant, small_plant
from agvbench.simulator.hidden import make_hidden_plant
from agvbench.types import Plant

TRUE_POSES: list[tuple[float, float, float]] = []
"""Of the plant in this process that was made last; this module is imported by its name, so there is one of it."""


class Told:
    """A plant that notes where it is."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        TRUE_POSES.clear()

    def reset(self, pose: tuple[float, float, float], *, seed: int) -> None:
        """Place it."""
        self._plant.reset(pose, seed=seed)

    def advance(self, drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float]:
        """Drive it."""
        TRUE_POSES.append(self._plant.advance(drive, front, rear, dt))
        return TRUE_POSES[-1]


def default(seed: int) -> Told:
    """Return the default plant."""
    return Told(make_plant(seed))


def differential(seed: int) -> Told:
    """Return the differential plant, whose markers are 3 mm off the centre line."""
    return Told(differential_plant(seed))


def random_differential(seed: int) -> Told:
    """Return a random differential plant."""
    return Told(random_differential_plant(seed))


def small(seed: int) -> Told:
    """Return the car that steers in front only, and is eight times as fast as is believed."""
    return Told(small_plant(seed))


def slack(seed: int) -> Told:
    """Return a vehicle with play in its steering that does not move for small commands."""
    return Told(make_hidden_plant("steering_backlash_and_drive_dead_band", seed, floors=0.0))


def late(seed: int) -> Told:
    """Return a vehicle with slow servos that is seen late."""
    return Told(make_hidden_plant("steering_lag_and_mocap_latency", seed, floors=0.0))


class Dead:
    """Does not move."""

    sense = 0.0

    def __init__(self, seed: int) -> None:
        self._pose = (0.0, 0.0, 0.0)

    def reset(self, pose: tuple[float, float, float], *, seed: int) -> None:
        """Place it."""
        self._pose = pose

    def advance(self, drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float]:
        """Drive it."""
        x_m, y_m, heading_rad = self._pose
        ahead = self.sense * (1500.0 - drive) * 5e-4 * dt
        self._pose = (x_m + ahead * math.cos(heading_rad), y_m + ahead * math.sin(heading_rad), heading_rad)
        return self._pose


class Contrary(Dead):
    """Drives the other way than it is told."""

    sense = -1.0


class Swapped(Dead):
    """Is taken for another one once it has driven 0.3 m."""

    sense = 1.0

    def advance(self, drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float]:
        """Drive it, and say what the camera takes for it."""
        x_m, y_m, heading_rad = super().advance(drive, front, rear, dt)
        return (x_m, y_m + 0.8, heading_rad) if x_m > 0.3 else (x_m, y_m, heading_rad)
