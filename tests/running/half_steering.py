"""Plants in other command channels: a steering, or a yaw rate, of 0…1 that is straight at 0.5."""

from __future__ import annotations

from agvbench.simulator import differential_plant, make_plant
from agvbench.types import Command, Plant
from agvbench.vehicle.channels import Channel, Channels

HALF = Channel("normalised", 0.5, 0.0, 1.0)
CHANNELS = Channels(Channel("normalised", 0.0, -1.0, 1.0), HALF, HALF)
TURNING = Channels(Channel("si", 0.0, -0.35, 0.35), HALF, HALF)


class HalfSteering:
    """Takes pulses of 900 to 2100 µs as shares of full command; keeps every command that it was given."""

    given: list[Command] = []  # noqa: RUF012 - of all plants, for the tests to look at

    def __init__(self, plant: Plant) -> None:
        self._plant = plant

    def reset(self, pose: tuple[float, float, float], *, seed: int) -> None:
        self._plant.reset(pose, seed=seed)

    def advance(self, drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float]:
        self.given.append(Command(drive, front, rear))
        front_us, rear_us = (1500.0 - 1200.0 * (share - 0.5) for share in (front, rear))
        return self._plant.advance(1500.0 - 600.0 * drive, front_us, rear_us, dt)


def make_half_steering(seed: int) -> HalfSteering:
    return HalfSteering(make_plant(seed))


class HalfTurning:
    """A differential vehicle: metres per second, and 0 to 1 for yaw rates of ∓1.2 rad/s."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant

    def reset(self, pose: tuple[float, float, float], *, seed: int) -> None:
        self._plant.reset(pose, seed=seed)

    def advance(self, drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float]:
        return self._plant.advance(drive, 2.4 * (front - 0.5), 0.0, dt)


def make_half_turning(seed: int) -> HalfTurning:
    return HalfTurning(differential_plant(seed))
