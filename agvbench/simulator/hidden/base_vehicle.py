"""The base vehicles of hidden plants: randomly sampled, quiet, and with nothing but static maps."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from agvbench.types import Kinematics

_DEG = math.pi / 180.0
FULL_OFFSET = 600.0
"""Command units from neutral to full command."""


@dataclass(frozen=True)
class BaseVehicle:
    """A vehicle that hides nothing: its constants by name, and its run-to-run play.

    The play is (rad, rad, relative) of both axles and of the speed; of a differential vehicle, it is that of its left
    and right wheel, as shares of their speeds.
    """

    constants: dict[str, float]
    run_variation: tuple[float, float, float]
    kinematics: Kinematics = "two_axle"


def sample_vehicle(rng: np.random.Generator) -> BaseVehicle:
    """Draw a vehicle of the thesis' build.

    Uniform: servo lines −0.072…−0.095 °/µs with offsets ±3° and end stops 38…45° on either side; dead band 15…45 µs,
    full speed 0.27…0.37 m/s, backward within 4 % of forward; axles 0.181 and 0.121 m; play 0.01…0.03° per axle and
    0.02…0.06 % of speed.
    """

    def draw(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    constants = {"front_axle": 0.181, "rear_axle": 0.121, "drive_dead": draw(15.0, 45.0)}
    for axle in ("front", "rear"):
        constants[f"{axle}_slope"] = -draw(0.072, 0.095) * _DEG
        constants[f"{axle}_offset"] = draw(-3.0, 3.0) * _DEG
        constants[f"{axle}_low"] = -draw(38.0, 45.0) * _DEG
        constants[f"{axle}_high"] = draw(38.0, 45.0) * _DEG
    full = draw(0.27, 0.37)
    reach = FULL_OFFSET - constants["drive_dead"]
    constants["gain_forward"] = full / reach
    constants["gain_backward"] = full * draw(0.96, 1.04) / reach
    return BaseVehicle(constants, (draw(0.01, 0.03) * _DEG, draw(0.01, 0.03) * _DEG, draw(0.0002, 0.0006)))


FULL_SPEED, FULL_YAW_RATE = 0.35, 1.2
"""Full commands of a differential vehicle [m/s, rad/s], those of the example that the bench ships."""


def sample_differential(rng: np.random.Generator) -> BaseVehicle:
    """Draw a vehicle with two driven wheels; its commands are a speed [m/s] and a yaw rate [rad/s].

    Uniform: speed 0.88…1.05 of the command beyond a dead band of 0.005…0.02 m/s, backward within 4 % of forward; yaw
    rate 0.75…1.05 of the command; track 0.2…0.4 m; markers 0.05 m ahead of the axle; play of each wheel 0.02…0.06 %.
    """

    def draw(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    gain, track = draw(0.88, 1.05), draw(0.2, 0.4)
    constants = {
        "differential": 1.0, "drive_sign": 1.0, "neutral": 0.0, "command_low": -2.0, "command_high": 2.0,
        "drive_dead": draw(0.005, 0.02), "gain_forward": gain, "gain_backward": gain * draw(0.96, 1.04),
        "front_slope": draw(0.75, 1.05), "front_low": -9.0, "front_high": 9.0, "rear_slope": 0.0,
        "front_axle": 0.0, "rear_axle": 0.05, "track": track,
    }  # fmt: skip
    return BaseVehicle(constants, (draw(0.0002, 0.0006), draw(0.0002, 0.0006), 0.0), "differential")
