"""The reference drives: what a session with the eight trajectories, calibration and steps asks of a vehicle.

They are made for the base vehicle, as a calibrated bench would command it: from its own maps, or, of a differential
vehicle, whose levels are shares of its full commands, from those.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from agvbench.simulator.hidden.base_vehicle import FULL_SPEED, FULL_YAW_RATE, BaseVehicle
from agvbench.simulator.hidden.constants import BASE
from agvbench.types import Floats, Plant

PRESTEER_S = 0.5
SETTLE_S = 1.0
SAMPLE_S = 0.05
FULL = 0.95
"""Share of the command range that counts as full: what a refitted map may still go beyond."""
_DEG = math.pi / 180.0


@dataclass(frozen=True)
class ReferenceDrive:
    """One drive: rows of (duration [s], drive, front, rear) in command units, from a start on the floor [m]."""

    name: str
    rows: tuple[tuple[float, float, float, float], ...]
    start: tuple[float, float] = (0.0, 0.0)


class _Commands:
    """Commands of a base vehicle for angles [rad] and shares of full speed."""

    def __init__(self, constants: dict[str, float]) -> None:
        self._p = BASE | constants

    def steer(self, axle: str, angle_rad: float) -> float:
        return self._p["neutral"] + (angle_rad - self._p[f"{axle}_offset"]) / self._p[f"{axle}_slope"]

    def speed(self, share: float) -> float:
        return self._p["neutral"] - FULL * share * 600.0 if share else self._p["neutral"]

    def speed_mps(self, share: float) -> float:
        gain = self._p["gain_forward"] if share > 0.0 else self._p["gain_backward"]
        return gain * max(0.0, FULL * abs(share) * 600.0 - self._p["drive_dead"])

    def drive(self, name: str, *parts: tuple[float, float, float, float]) -> ReferenceDrive:
        """Return a drive of parts (duration, share of speed, front angle, rear angle), steered before it starts."""
        _, _, front, rear = parts[0]
        rows = [(PRESTEER_S, 0.0, front, rear), *parts, (SETTLE_S, 0.0, *parts[-1][2:])]
        return ReferenceDrive(
            name, tuple((s, self.speed(v), self.steer("front", f), self.steer("rear", r)) for s, v, f, r in rows)
        )


def reference_drives(base: BaseVehicle) -> list[ReferenceDrive]:
    """Return the drives for a base vehicle of either kind."""
    return _of_wheels(base.constants) if base.kinematics == "differential" else _of_axles(base.constants)


def _of_axles(constants: dict[str, float]) -> list[ReferenceDrive]:
    """Return the eight, holds of the servos and the drive, steps, a slalom."""
    c = _Commands(constants)
    front = math.atan((BASE | constants)["front_axle"])  # centre of rotation 1 m abeam of the centroid
    rear = -math.atan((BASE | constants)["rear_axle"])
    drives = [c.drive(f"straight {v:+g}", (2.0 / c.speed_mps(v), v, 0.0, 0.0)) for v in (1.0, -1.0, 0.5, -0.5)]
    for v in (1.0, -1.0):
        quarter_s = 0.5 * math.pi / c.speed_mps(v)
        drives += [c.drive(f"turn {v:+g} {s:+g}", (quarter_s, v, s * front, s * rear)) for s in (1.0, -1.0)]
    for angle in (36.0, 15.0, -15.0, -36.0):
        drives.append(c.drive(f"front {angle:+g}", (5.0, 1.0, angle * _DEG, 0.0)))
        drives.append(c.drive(f"rear {angle:+g}", (5.0, 1.0, 0.0, angle * _DEG)))
    drives += [c.drive(f"opposite {a:+g}", (5.0, 1.0, a * _DEG, -a * _DEG)) for a in (20.0, -20.0)]
    drives += [c.drive(f"drive {v:+g}", (4.0, v, 0.0, 0.0)) for v in (0.75, 0.2, -0.2, -0.75)]
    a = 15.0 * _DEG
    for v in (1.0, -1.0):
        drives.append(c.drive(f"front steps {v:+g}", *((1.5, v, s * a, 0.0) for s in (0.0, 1.0, 0.0, -1.0, 0.0))))
        drives.append(c.drive(f"rear steps {v:+g}", *((1.5, v, 0.0, s * a) for s in (0.0, 1.0, 0.0, -1.0, 0.0))))
    for v in (1.0, 0.5):
        drives.append(c.drive(f"slalom {v:+g}", *((1.0, v, s * a, -s * a) for s in (1.0, -1.0, 1.0, -1.0, 1.0, -1.0))))
    return drives


def _of_wheels(constants: dict[str, float]) -> list[ReferenceDrive]:
    """Return straights, turns on the spot, arcs, steps and a slalom; yaw rates are shares of the full one."""
    gain, dead = constants["gain_forward"], constants["drive_dead"]
    full = gain * (FULL * FULL_SPEED - dead)

    def drive(name: str, *parts: tuple[float, float, float]) -> ReferenceDrive:
        rows = ((PRESTEER_S, 0.0, 0.0), *parts, (SETTLE_S, 0.0, 0.0))
        return ReferenceDrive(
            name, tuple((s, FULL * FULL_SPEED * v, FULL * FULL_YAW_RATE * w, 0.0) for s, v, w in rows)
        )

    drives = [drive(f"straight {v:+g}", (2.0 / full / abs(v), v, 0.0)) for v in (1.0, -1.0, 0.5, -0.5)]
    drives += [drive(f"drive {v:+g}", (4.0, v, 0.0)) for v in (0.75, 0.2, -0.2, -0.75)]
    drives += [drive(f"turn on the spot {w:+g}", (4.0, 0.0, w)) for w in (1.0, 2 / 3, 1 / 3, -1 / 3, -2 / 3, -1.0)]
    for v in (1.0, 0.5, -0.5, -1.0):
        drives += [drive(f"arc {v:+g} {w:+.2g}", (4.0, v, w)) for w in (2 / 3, 1 / 3, -1 / 3, -2 / 3)]
    for v in (1.0, -1.0):
        drives.append(drive(f"steps {v:+g}", *((1.5, v, w) for w in (0.0, 0.5, 0.0, -0.5, 0.0))))
    for v in (1.0, 0.5):
        drives.append(drive(f"slalom {v:+g}", *((1.0, v, w) for w in (0.5, -0.5, 0.5, -0.5, 0.5, -0.5))))
    return drives


def path(plant: Plant, drive: ReferenceDrive, *, seed: int = 0) -> Floats:
    """Return the poses (n, 3) of a drive, heading along x at its start, one every 50 ms and at the end of a row."""
    plant.reset((*drive.start, 0.0), seed=seed)
    poses: list[tuple[float, float, float]] = []
    for duration_s, wheel, front, rear in drive.rows:
        whole = int(duration_s / SAMPLE_S)
        steps = [SAMPLE_S] * whole + [duration_s - whole * SAMPLE_S]
        poses.extend(plant.advance(wheel, front, rear, dt) for dt in steps)
    return np.array(poses)


def centred(plant: Plant, drive: ReferenceDrive) -> ReferenceDrive:
    """Return the drive begun where its path lies about the middle of the room, as a bench places it."""
    poses = path(plant, drive)
    middle = 0.5 * (poses.min(axis=0) + poses.max(axis=0))
    return replace(drive, start=(drive.start[0] - float(middle[0]), drive.start[1] - float(middle[1])))
