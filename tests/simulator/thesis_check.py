"""The eight trajectories, driven with nominal and with ideal static maps, on nothing but the plant protocol.

The ideal maps are read off the plant itself: steady angles and speeds at every pulse, seen through the geometry of
the vehicle's file. Run as a script, it prints the table of `docs/reference/simulator.md`::

    python tests/simulator/thesis_check.py
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from agvbench.types import Floats, Plant

FRONT_AXLE_M, REAR_AXLE_M, NEUTRAL = 0.181, 0.121, 1500.0
PULSES = np.arange(900.0, 2101.0, 25.0)
# number: (turn, +1 left, −1 right, 0 straight; direction; share of full speed), tables 8.3 to 8.10
EIGHT = {
    1: (0, 1, 1.0), 2: (0, -1, 1.0), 3: (0, 1, 0.5), 4: (0, -1, 0.5),
    5: (1, 1, 1.0), 6: (-1, 1, 1.0), 7: (1, -1, 1.0), 8: (-1, -1, 1.0),
}  # fmt: skip
FULL_SPEED_MPS = 0.32


def steady_motion(plant: Plant, drive: float, front: float, rear: float) -> tuple[float, float, float]:
    """Return front angle, rear angle [rad] and speed [m/s] once the motion is steady."""
    plant.reset((0.0, 0.0, 0.0), seed=0)
    plant.advance(drive, front, rear, 1.5)
    dt = 1e-3
    before = plant.advance(drive, front, rear, dt)
    after = plant.advance(drive, front, rear, dt)
    dx, dy = (after[0] - before[0]) / dt, (after[1] - before[1]) / dt
    yaw_rate = (after[2] - before[2]) / dt
    middle = 0.5 * (after[2] + before[2])
    ahead = math.cos(middle) * dx + math.sin(middle) * dy
    left = -math.sin(middle) * dx + math.cos(middle) * dy
    sense = math.copysign(1.0, ahead)
    front_rad = math.atan2(sense * (left + FRONT_AXLE_M * yaw_rate), abs(ahead))
    rear_rad = math.atan2(sense * (left - REAR_AXLE_M * yaw_rate), abs(ahead))
    return front_rad, rear_rad, sense * math.hypot(dx, dy)


@dataclass(frozen=True)
class Maps:
    """Pulse → angle [rad] and pulse → speed [m/s], as tables to be inverted; falling."""

    front: Floats
    rear: Floats
    speed: Floats

    def pulses(self, front_rad: float, rear_rad: float, speed_mps: float) -> tuple[float, float, float]:
        """Return (drive, front, rear) in µs."""
        wanted, tables = (speed_mps, front_rad, rear_rad), (self.speed, self.front, self.rear)
        drive, front, rear = (
            float(np.interp(w, table[::-1], PULSES[::-1])) for w, table in zip(wanted, tables, strict=True)
        )
        return drive, front, rear


NOMINAL = Maps(
    front=np.radians(-0.075 * (PULSES - NEUTRAL)),
    rear=np.radians(-0.075 * (PULSES - NEUTRAL)),
    speed=FULL_SPEED_MPS * (NEUTRAL - PULSES) / 600.0,
)


def ideal_maps(plant: Plant) -> Maps:
    """Read the plant's steady maps off it, as a faultless static calibration would: steering driving forward."""
    front = np.array([steady_motion(plant, 900.0, p, NEUTRAL)[0] for p in PULSES])
    rear = np.array([steady_motion(plant, 900.0, NEUTRAL, p)[1] for p in PULSES])
    speed = np.array([steady_motion(plant, p, NEUTRAL, NEUTRAL)[2] for p in PULSES])
    speed[np.abs(speed) < 1e-3] = 0.0
    return Maps(front, rear, np.minimum.accumulate(speed))


def drive(plant: Plant, number: int, maps: Maps, full_mps: tuple[float, float], seed: int) -> tuple[float, float]:
    """Drive a trajectory; return Δs [mm] and how much further than its target it turned [deg], on a straight: left.

    `full_mps`: forward and backward full speed believed.
    """
    turn, direction, share = EIGHT[number]
    front_rad, rear_rad = math.atan2(turn * FRONT_AXLE_M, 1.0), math.atan2(-turn * REAR_AXLE_M, 1.0)
    length = math.pi / 2 if turn else 2.0
    full = full_mps[0 if direction > 0 else 1]
    _, front, rear = maps.pulses(front_rad, rear_rad, 0.0)
    pulse = NEUTRAL - 600.0 * direction if share == 1.0 else maps.pulses(0.0, 0.0, direction * share * full)[0]
    plant.reset((0.0, 0.0, 0.0), seed=seed)
    plant.advance(pulse, front, rear, length / (share * full))
    x, y, heading = plant.advance(NEUTRAL, NEUTRAL, NEUTRAL, 3.0)
    side = turn * direction or 1
    turned = math.degrees(side * heading) - (90.0 if turn else 0.0)
    return 1e3 * (math.hypot(x, y) - (math.sqrt(2.0) if turn else 2.0)), turned


def medians(plant: Plant, maps: Maps, full_mps: tuple[float, float], repeats: int) -> dict[int, tuple[float, float]]:
    """Return the medians of what `drive` returns, for every trajectory."""
    result = {}
    for number in EIGHT:
        runs = [drive(plant, number, maps, full_mps, seed) for seed in range(1, repeats + 1)]
        ds, dh = np.median(np.array(runs), axis=0)
        result[number] = (float(ds), float(dh))
    return result


def main() -> None:
    """Print simulated beside measured medians."""
    from agvbench.simulator import make_plant
    from agvbench.simulator.plants import THESIS_VEHICLE
    from agvbench.simulator.vehicle_parameters import RunVariation
    from agvbench.simulator.vehicle_plant import VehiclePlant

    measured = {
        1: (83.03, 5.1, 5.9, 1.9), 2: (18.34, 3.4, 14.6, 2.3), 3: (math.nan, math.nan, 10.3, 2.2),
        4: (math.nan, math.nan, 10.1, 3.2), 5: (13.22, 13.1, 8.0, -0.3), 6: (46.17, 8.1, 55.5, 3.2),
        7: (136.15, -9.5, 9.6, -4.2), 8: (68.29, -7.2, 62.9, -3.1),
    }  # fmt: skip
    plant = make_plant(0)
    maps = ideal_maps(VehiclePlant(replace(THESIS_VEHICLE, run_variation=RunVariation(0.0, 0.0, 0.0)), 0))
    nominal = medians(plant, NOMINAL, (FULL_SPEED_MPS, FULL_SPEED_MPS), 20)
    ideal = medians(plant, maps, (float(maps.speed[0]), float(-maps.speed[-1])), 20)
    print("| trajectory | uncal. Δs [mm] | thesis \\|Δs\\| | uncal. Δδ [deg] | thesis | ideal Δs [mm] | thesis \\|Δs\\| | ideal Δδ [deg] | thesis |")  # fmt: skip  # noqa: E501
    print("|---|---|---|---|---|---|---|---|---|")
    for number, (s0, h0, s1, h1) in measured.items():
        a, b = nominal[number], ideal[number]
        if math.isnan(s0):
            a = (math.nan, math.nan)  # no half speed is known without calibration
        cells = (a[0], s0, a[1], h0, b[0], s1, b[1], h1)
        print(f"| {number} | " + " | ".join("–" if math.isnan(c) else f"{c:.1f}" for c in cells) + " |")


if __name__ == "__main__":
    main()
