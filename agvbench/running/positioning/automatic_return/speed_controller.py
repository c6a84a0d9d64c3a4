"""Speed control, closed loop: the share of full command that moves a vehicle as fast as wanted."""

from __future__ import annotations

from agvbench.running.positioning.automatic_return.online_adaptation import DriveAdaptation

_MOVING_MPS = 0.012
_RAMP_PER_S = 0.12
_PATIENCE_S = 0.5
_BANDWIDTH_PER_S = 1.5
_MOST_CHANGE = 0.04


class SpeedController:
    """A ramp until the vehicle moves, then an integral controller whose gain follows from what the share does.

    A drive's slope is not known: speed over the share beyond the one at which it began to move is near enough, and
    errs to the safe side where the drive is steeper further up.
    """

    def __init__(self, adaptation: DriveAdaptation, speed_mps: float) -> None:
        self._adaptation, self._setpoint_mps = adaptation, speed_mps
        self.share = adaptation.initial_share(speed_mps)
        self._moved = False
        self._ramped = False
        self._waited_s = 0.0
        self._steady = 0

    def set_setpoint(self, speed_mps: float) -> None:
        """Change the speed wanted, [m/s] without sign."""
        if speed_mps == self._setpoint_mps:
            return
        onset = min(self._adaptation.onset, self.share)
        prior = onset + (self.share - onset) * speed_mps / self._setpoint_mps
        known = self._adaptation.initial_share(speed_mps)
        self.share = known if known > self._adaptation.onset else prior
        self._setpoint_mps, self._steady = speed_mps, 0

    def step(self, speed_mps: float, dt_s: float) -> float:
        """Return the share to hold next, `speed_mps` [m/s] along the way being what was seen."""
        if speed_mps < _MOVING_MPS:
            self._wait(dt_s)
        else:
            self._regulate(speed_mps, dt_s)
        self.share = min(1.0, max(0.0, self.share))
        return self.share

    def _wait(self, dt_s: float) -> None:
        self._waited_s += dt_s
        if self._waited_s > _PATIENCE_S or self.share == 0.0:
            self.share += _RAMP_PER_S * dt_s
            self._ramped = not self._moved

    def _regulate(self, speed_mps: float, dt_s: float) -> None:
        if not self._moved and self._ramped:
            self._adaptation.onset = max(0.0, self.share - 0.3 * _RAMP_PER_S)
        self._moved, self._waited_s = True, 0.0
        slope = speed_mps / max(self.share - self._adaptation.onset, 0.03)
        change = _BANDWIDTH_PER_S * dt_s * (self._setpoint_mps - speed_mps) / max(slope, 0.1)
        self.share += min(_MOST_CHANGE, max(-_MOST_CHANGE, change))
        near = abs(speed_mps - self._setpoint_mps) < 0.15 * self._setpoint_mps
        self._steady = self._steady + 1 if near else 0
        if self._steady >= 4:
            self._adaptation.record_share(self._setpoint_mps, self.share)
