"""Online adaptation: how a returning vehicle answers to its commands, estimated while it drives.

A believed model may be wrong in every number, or know nothing but full speed. What following a path needs is little:
how much a vehicle turns for a curvature asked of it, at which angle to its heading it moves, which share of full
command moves it how fast, and how far it rolls on after a stop.
"""

from __future__ import annotations

import numpy as np

from agvbench.running.positioning.automatic_return.motion_interface import Step

_GAINS = (0.4, 2.0)
"""What is believed of a gain: beyond, it was learned from too little."""
_BLOCK_M = 0.08
"""Steps are taken together until they are so long: delays and noise matter less."""
_TURN_NOISE_RAD, _SIDE_NOISE_M = 0.004, 0.0008
_GAIN_GUESS, _OFFSET_GUESS_PER_M, _CRAB_GUESS_RAD = 0.15, 0.4, 0.06
"""Standard deviations of what is believed of a vehicle that has not driven yet."""
_GAIN_WANDER, _OFFSET_WANDER, _CRAB_WANDER = 0.02, 0.2, 0.06
"""How far each may change per square root of a metre driven: (–), [1/m], [rad]."""


class SteeringHabit:
    """Kalman filters of ``curvature = gain · asked + offset`` and of the crab angle, over the distance driven."""

    def __init__(self) -> None:
        self._state = np.array([1.0, 0.0])
        self._covariance = np.diag([_GAIN_GUESS**2, _OFFSET_GUESS_PER_M**2])
        self.crab_rad = 0.0
        self._crab_variance = _CRAB_GUESS_RAD**2
        self._block = np.zeros(4)

    def as_guess(self) -> SteeringHabit:
        """Return a habit that begins where this one is, and is as ready to learn as a new one."""
        guess = SteeringHabit()
        guess._state, guess.crab_rad = self._state.copy(), self.crab_rad
        return guess

    def asked_for(self, curvature_per_m: float) -> float:
        """Return the curvature [1/m] to ask for so that the vehicle turns at `curvature_per_m`."""
        gain, offset = float(self._state[0]), float(self._state[1])
        return (curvature_per_m - offset) / min(_GAINS[1], max(_GAINS[0], gain))

    def begin(self) -> None:
        """Leave out what was begun to be taken together: the vehicle has stood."""
        self._block[:] = 0.0

    def learn(self, asked_per_m: float, step: Step, *, ahead_m: float) -> None:
        """Take in a step driven while `asked_per_m` was asked for.

        `ahead_m` is how far ahead of the markers' centroid the guided point lies, whose crab angle is meant.
        """
        side_m = step.left_m + ahead_m * step.turn_rad
        self._block += (step.ahead_m, asked_per_m * step.ahead_m, step.turn_rad, side_m)
        if abs(self._block[0]) >= _BLOCK_M:
            self._turned(*self._block[:3].tolist())
            self._crabbed(float(self._block[0]), float(self._block[3]))
            self._block[:] = 0.0

    def _turned(self, ahead_m: float, asked_rad: float, turn_rad: float) -> None:
        self._covariance += abs(ahead_m) * np.diag([_GAIN_WANDER**2, _OFFSET_WANDER**2])
        row = np.array([asked_rad, ahead_m])
        spread = self._covariance @ row
        share = spread / (row @ spread + _TURN_NOISE_RAD**2)
        self._state += share * (turn_rad - row @ self._state)
        self._covariance -= np.outer(share, spread)

    def _crabbed(self, ahead_m: float, side_m: float) -> None:
        self._crab_variance += abs(ahead_m) * _CRAB_WANDER**2
        share = self._crab_variance * ahead_m / (self._crab_variance * ahead_m**2 + _SIDE_NOISE_M**2)
        self.crab_rad += share * (side_m - self.crab_rad * ahead_m)
        self._crab_variance *= 1.0 - share * ahead_m


class DriveHabit:
    """The share of full command that moves the vehicle at a speed, and how long it rolls on [s of its speed]."""

    def __init__(self) -> None:
        self.onset = 0.0
        self.coast_s = 0.25
        self._shares: dict[float, float] = {}

    def first_guess(self, speed_mps: float) -> float:
        """Return a share that will not be too much for `speed_mps`."""
        return self._shares.get(speed_mps, self.onset)

    def keeps(self, speed_mps: float, share: float) -> None:
        """Remember which share kept `speed_mps`."""
        self._shares[speed_mps] = share

    def rolled(self, distance_m: float, speed_mps: float) -> None:
        """Remember how far the vehicle rolled after it was told to stop."""
        if speed_mps > 0.02:
            self.coast_s += 0.5 * (float(np.clip(distance_m / speed_mps, 0.0, 1.5)) - self.coast_s)


class Habits:
    """The habits of one vehicle in either gear. Until it has driven in one, what the other taught is the best guess."""

    def __init__(self) -> None:
        self._steering: dict[bool, SteeringHabit] = {}
        self._drive: dict[bool, DriveHabit] = {}

    def steering(self, backward: bool) -> SteeringHabit:
        """Return how it steers."""
        if backward not in self._steering:
            other = self._steering.get(not backward)
            self._steering[backward] = SteeringHabit() if other is None else other.as_guess()
        return self._steering[backward]

    def drive(self, backward: bool) -> DriveHabit:
        """Return how it drives."""
        return self._drive.setdefault(backward, DriveHabit())

    @property
    def crab_rad(self) -> float:
        """The crab angle [rad], whichever way it drives."""
        known = list(self._steering.values())
        return sum(habit.crab_rad for habit in known) / len(known) if known else 0.0
