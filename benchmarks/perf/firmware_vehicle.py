"""A vehicle without variation between runs whose static maps are known: only firmware and line make runs differ.

`make_plant` is the vehicle for ``--plant benchmarks/perf/firmware_vehicle.py:make_plant``, `nominal_vehicle` the
model that equals it. Its pulses take effect at once: it adds no servo frame of its own to that of the firmware.
"""

from __future__ import annotations

from agvbench.model import VehicleModel
from agvbench.simulator.hidden import HiddenPlant, SealedTruth
from agvbench.simulator.hidden.constants import BASE
from agvbench.vehicle.channels import Channels
from agvbench.vehicle.geometry import Geometry
from agvbench.vehicle.maps import DeadBandWithSaturation, LineWithEndStops

NO_PLAY = (0.0, 0.0, 0.0)
THESIS_PLAY = (0.0021, 0.0021, 0.003)
"""Standard deviations between runs: 0.12° of each axle, 0.3 % of speed (tables 7.1 and 8.3–8.6)."""


def make_plant(seed: int) -> HiddenPlant:
    """Return the vehicle: 0.32 m/s at full command, 48° of steering per 600 µs, nothing at random."""
    return _plant(seed, NO_PLAY)


def make_scattering_plant(seed: int) -> HiddenPlant:
    """Return it with a variation between runs like that of the thesis' vehicle."""
    return _plant(seed, THESIS_PLAY)


def _plant(seed: int, play: tuple[float, float, float]) -> HiddenPlant:
    return HiddenPlant(dict(BASE), play, seed, SealedTruth("nothing", constants=dict(BASE)))


def nominal_vehicle() -> VehicleModel:
    """Return the model that knows all of it."""
    neutral, dead = BASE["neutral"], BASE["drive_dead"]
    low, high = BASE["command_low"], BASE["command_high"]
    forward = BASE["gain_forward"] * (neutral - dead - low)
    backward = BASE["gain_backward"] * (high - neutral - dead)
    return VehicleModel(
        name="firmware_vehicle",
        geometry=Geometry(BASE["front_axle"], BASE["rear_axle"]),
        channels=Channels.alike("us"),
        front=_servo("front"),
        rear=_servo("rear"),
        drive=DeadBandWithSaturation(low, neutral - dead, neutral + dead, high, forward, -backward),
    )


def _servo(axle: str) -> LineWithEndStops:
    slope = BASE[f"{axle}_slope"]
    intercept = BASE[f"{axle}_offset"] - slope * BASE["neutral"]
    return LineWithEndStops(slope, intercept, BASE[f"{axle}_low"], BASE[f"{axle}_high"])
