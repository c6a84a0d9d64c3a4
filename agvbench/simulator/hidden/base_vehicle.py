"""The base vehicle of a hidden plant: randomly sampled, quiet, and with nothing but static maps."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

_DEG = math.pi / 180.0
FULL_OFFSET = 600.0
"""Command units from neutral to full command."""


@dataclass(frozen=True)
class BaseVehicle:
    """A vehicle that hides nothing: its constants by name, and its run-to-run play (rad, rad, relative)."""

    constants: dict[str, float]
    run_variation: tuple[float, float, float]


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
