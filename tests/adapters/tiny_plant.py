"""A plant of a few lines: it drives straight, steers by its front command, and wears with every metre."""

from __future__ import annotations

import math
import random


class TinyPlant:
    def __init__(self, seed: int) -> None:
        self.gain = 1.0 + 0.01 * random.Random(seed).random()
        self.worn_m = 0.0

    def reset(self, pose: tuple[float, float, float], *, seed: int) -> None:
        self.x_m, self.y_m, self.heading_rad = pose
        self.luck = random.Random(seed).gauss(1.0, 0.01)

    def advance(self, drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float]:
        speed_mps = self.gain * self.luck * (drive - 1500.0) / 1000.0 / (1.0 + 0.1 * self.worn_m)
        self.heading_rad += dt * speed_mps * (front - rear) / 1000.0
        self.x_m += dt * speed_mps * math.cos(self.heading_rad)
        self.y_m += dt * speed_mps * math.sin(self.heading_rad)
        self.worn_m += abs(dt * speed_mps)
        return self.x_m, self.y_m, self.heading_rad


class UnwornPlant(TinyPlant):
    def reset(self, pose: tuple[float, float, float], *, seed: int) -> None:
        super().reset(pose, seed=seed)
        self.worn_m = 0.0


class HangingPlant(TinyPlant):
    def advance(self, drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float]:
        if drive > 1600.0:
            import time

            time.sleep(3600.0)
        return super().advance(drive, front, rear, dt)


class FailingPlant(TinyPlant):
    def advance(self, drive: float, front: float, rear: float, dt: float) -> tuple[float, float, float]:
        if drive > 1600.0:
            raise ZeroDivisionError("speed of light reached")
        return super().advance(drive, front, rear, dt)


class HangingInResetPlant(TinyPlant):
    def reset(self, pose: tuple[float, float, float], *, seed: int) -> None:
        import time

        time.sleep(3600.0)
