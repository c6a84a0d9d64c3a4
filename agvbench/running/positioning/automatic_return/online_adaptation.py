"""Online adaptation: how a returning vehicle answers to its commands, estimated while it drives.

A nominal model may be wrong in every number, or know nothing but full speed. Path following needs little of it: how
much the vehicle turns for a curvature commanded, at which angle to its heading it moves, which share of full command
moves it how fast, and how far it rolls on after a stop.
"""

from __future__ import annotations

import numpy as np

from agvbench.running.positioning.automatic_return.motion_interface import Step

_GAINS = (0.4, 2.0)
"""Plausible gains: beyond, a gain was learned from too little."""
_BLOCK_M = 0.08
"""Steps are taken together until they are so long: delays and noise matter less."""
_TURN_NOISE_RAD, _SIDE_NOISE_M = 0.004, 0.0008
_GAIN_SD, _OFFSET_SD_PER_M, _CRAB_SD_RAD = 0.15, 0.4, 0.06
"""Prior standard deviations, of a vehicle that has not driven yet."""
_GAIN_RANDOM_WALK, _OFFSET_RANDOM_WALK, _CRAB_RANDOM_WALK = 0.02, 0.2, 0.06
"""How far each may change per square root of a metre driven: (–), [1/m], [rad]."""


class SteeringAdaptation:
    """Kalman filters of ``curvature = gain · asked + offset`` and of the crab angle, over the distance driven."""

    def __init__(self) -> None:
        self._state = np.array([1.0, 0.0])
        self._covariance = np.diag([_GAIN_SD**2, _OFFSET_SD_PER_M**2])
        self.crab_rad = 0.0
        self._crab_variance = _CRAB_SD_RAD**2
        self._block = np.zeros(4)

    def as_prior(self) -> SteeringAdaptation:
        """Return an adaptation that begins where this one is, and learns as fast as a new one."""
        prior = SteeringAdaptation()
        prior._state, prior.crab_rad = self._state.copy(), self.crab_rad
        return prior

    def commanded_for(self, curvature_per_m: float) -> float:
        """Return the curvature [1/m] to ask for so that the vehicle turns at `curvature_per_m`."""
        gain, offset = float(self._state[0]), float(self._state[1])
        return (curvature_per_m - offset) / min(_GAINS[1], max(_GAINS[0], gain))

    def begin(self) -> None:
        """Leave out what was begun to be taken together: the vehicle has stood."""
        self._block[:] = 0.0

    def update(self, commanded_per_m: float, step: Step, *, forward_m: float) -> None:
        """Take in a step driven while `commanded_per_m` was asked for.

        `forward_m` is how far ahead of the markers' centroid the guided point lies, whose crab angle is meant.
        """
        side_m = step.left_m + forward_m * step.turn_rad
        self._block += (step.forward_m, commanded_per_m * step.forward_m, step.turn_rad, side_m)
        if abs(self._block[0]) >= _BLOCK_M:
            self._update_curvature(*self._block[:3].tolist())
            self._update_crab_angle(float(self._block[0]), float(self._block[3]))
            self._block[:] = 0.0

    def _update_curvature(self, forward_m: float, commanded_rad: float, turn_rad: float) -> None:
        self._covariance += abs(forward_m) * np.diag([_GAIN_RANDOM_WALK**2, _OFFSET_RANDOM_WALK**2])
        row = np.array([commanded_rad, forward_m])
        spread = self._covariance @ row
        share = spread / (row @ spread + _TURN_NOISE_RAD**2)
        self._state += share * (turn_rad - row @ self._state)
        self._covariance -= np.outer(share, spread)

    def _update_crab_angle(self, forward_m: float, side_m: float) -> None:
        self._crab_variance += abs(forward_m) * _CRAB_RANDOM_WALK**2
        share = self._crab_variance * forward_m / (self._crab_variance * forward_m**2 + _SIDE_NOISE_M**2)
        self.crab_rad += share * (side_m - self.crab_rad * forward_m)
        self._crab_variance *= 1.0 - share * forward_m


class DriveAdaptation:
    """The share of full command that moves the vehicle at a speed, and how long it rolls on [s of its speed]."""

    def __init__(self) -> None:
        self.onset = 0.0
        self.coast_s = 0.25
        self._shares: dict[float, float] = {}

    def initial_share(self, speed_mps: float) -> float:
        """Return a share that will not be too much for `speed_mps`."""
        return self._shares.get(speed_mps, self.onset)

    def record_share(self, speed_mps: float, share: float) -> None:
        """Remember which share kept `speed_mps`."""
        self._shares[speed_mps] = share

    def record_coasting(self, distance_m: float, speed_mps: float) -> None:
        """Remember how far the vehicle rolled after it was commanded to stop."""
        if speed_mps > 0.02:
            self.coast_s += 0.5 * (float(np.clip(distance_m / speed_mps, 0.0, 1.5)) - self.coast_s)


class OnlineAdaptation:
    """The adaptation of one vehicle in either gear. Until it has driven in one, the other's is the best guess."""

    def __init__(self) -> None:
        self._steering: dict[bool, SteeringAdaptation] = {}
        self._drive: dict[bool, DriveAdaptation] = {}

    def steering(self, backward: bool) -> SteeringAdaptation:
        """Return how it steers."""
        if backward not in self._steering:
            other = self._steering.get(not backward)
            self._steering[backward] = SteeringAdaptation() if other is None else other.as_prior()
        return self._steering[backward]

    def drive(self, backward: bool) -> DriveAdaptation:
        """Return how it drives."""
        return self._drive.setdefault(backward, DriveAdaptation())

    @property
    def crab_rad(self) -> float:
        """The crab angle [rad], whichever way it drives."""
        known = list(self._steering.values())
        return sum(adaptation.crab_rad for adaptation in known) / len(known) if known else 0.0
