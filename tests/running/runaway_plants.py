"""Plants that go wrong in the middle of a run: plant factories for tests of the supervisor."""

from __future__ import annotations

import math


class Straight:
    """Drives at 0.4 m/s while it is told to, along the x axis."""

    def __init__(self, seed: int) -> None:
        self._pose, self.t_s = (0.0, 0.0, 0.0), 0.0

    def reset(self, pose: tuple[float, float, float], *, seed: int) -> None:
        """Put it somewhere."""
        self._pose, self.t_s = pose, 0.0

    def advance(self, drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float]:
        """Drive."""
        x_m, y_m, heading_rad = self._pose
        speed = 0.4 * (drive > 1600.0)
        self._pose = (x_m + speed * dt * math.cos(heading_rad), y_m + speed * dt * math.sin(heading_rad), heading_rad)
        self.t_s += dt
        return self.seen()

    def seen(self) -> tuple[float, float, float]:
        """Return what the camera sees."""
        return self._pose


class Swapped(Straight):
    """Is taken for another body after a second."""

    def seen(self) -> tuple[float, float, float]:
        """Return the other body's pose."""
        x_m, y_m, heading_rad = self._pose
        return (x_m, y_m + 0.8, heading_rad) if self.t_s > 1.5 else self._pose
