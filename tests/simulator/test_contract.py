"""Every plant that ships keeps every clause of the contract; every clause catches a plant that breaks it."""

from __future__ import annotations

import itertools
import math

import pytest

from agvbench.errors import PlantError
from agvbench.simulator import check_plant
from agvbench.simulator.plant_contract import CLAUSES, subject_of
from agvbench.simulator.plants import PLANTS

UNITS = {"small_plant": "normalised", "differential_plant": "si", "random_differential_plant": "si"}


@pytest.mark.parametrize("clause", CLAUSES.values(), ids=CLAUSES)
@pytest.mark.parametrize("name", PLANTS)
def test_shipped_plant_keeps_clause(name, clause):
    clause(subject_of(f"agvbench.simulator.plants:{name}", UNITS.get(name, "us")))


class Cart:
    """Honest and simple: drives along its heading, steers by front and rear."""

    def __init__(self, seed):
        self.pose, self.speed = (0.0, 0.0, 0.0), 0.0

    def reset(self, pose, *, seed):
        self.pose, self.speed = pose, 0.0

    def advance(self, drive, front, rear, dt):
        x, y, heading = self.pose
        self.speed = (1500.0 - drive) / 2000.0
        half = 0.5 * dt * self.speed * (rear - front) / 600.0  # of the turn: the chord of an arc is exact
        chord = dt * self.speed * (math.sin(half) / half if half else 1.0)
        self.pose = (x + chord * math.cos(heading + half), y + chord * math.sin(heading + half), heading + 2.0 * half)
        return self.pose


class NeverReset(Cart):
    def reset(self, pose, *, seed):
        pass


class KeepsRolling(Cart):
    def reset(self, pose, *, seed):
        self.pose = pose

    def advance(self, drive, front, rear, dt):
        if drive != 1500.0:
            return super().advance(drive, front, rear, dt)
        x, y, heading = self.pose
        return (x + dt * self.speed, y, heading)


class Moody(Cart):
    count = itertools.count()

    def advance(self, drive, front, rear, dt):
        x, y, heading = super().advance(drive, front, rear, dt)
        return x + 1e-9 * next(self.count), y, heading


class Shared(Cart):
    odometer: list[float] = []  # noqa: RUF012 - that is what is wrong with it

    def __init__(self, seed):
        super().__init__(seed)
        if seed == 3:
            self.odometer.clear()

    def advance(self, drive, front, rear, dt):
        x, y, heading = super().advance(drive, front, rear, dt)
        self.odometer.append(dt)
        return x + 1e-9 * len(self.odometer), y, heading


class Fragile(Cart):
    def advance(self, drive, front, rear, dt):
        if front == 2100.0 == rear:
            return (math.nan,) * 3
        return super().advance(drive, front, rear, dt)


class Impatient(Cart):
    def advance(self, drive, front, rear, dt):
        if dt > 5.0:
            raise ValueError(f"dt is {dt}")
        return super().advance(drive, front, rear, dt)


class FixedStep(Cart):
    def advance(self, drive, front, rear, dt):
        return super().advance(drive, front, rear, 0.01)


class Millimetres(Cart):
    def advance(self, drive, front, rear, dt):
        return super().advance(1500.0 + 1000.0 * (drive - 1500.0), front, rear, dt)


class Parked(Cart):
    def advance(self, drive, front, rear, dt):
        return self.pose


BROKEN = {
    "stays_where_it_is_put": NeverReset,
    "reset_stops_it": KeepsRolling,
    "same_seed_same_plant": Moody,
    "plants_share_nothing": Shared,
    "stands_every_command": Fragile,
    "takes_every_time_step": Impatient,
    "time_adds_up": FixedStep,
    "moves_without_jumps": Millimetres,
    "obeys_drive": Parked,
}


@pytest.mark.parametrize("name", CLAUSES)
def test_clause_catches_a_plant_that_breaks_it(name):
    with pytest.raises(PlantError):
        CLAUSES[name](subject_of(BROKEN[name]))


def test_an_honest_plant_of_ten_lines_keeps_the_contract():
    check_plant(Cart)


def test_check_plant_names_plant_and_clause():
    with pytest.raises(PlantError, match=r"^Parked: \[obeys_drive\] vehicle did not move under full drive: 0.0 mm"):
        check_plant(Parked)
