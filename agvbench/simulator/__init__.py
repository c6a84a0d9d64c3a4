"""Plants and sensor noise: an independent truth that shares no code with the vehicle model.

What an author of plants needs is here: the protocol, and `check_plant`, which holds a plant to it.
"""

from agvbench.simulator.camera import Camera, Tracker
from agvbench.simulator.checked_plant import CheckedPlant
from agvbench.simulator.plant_contract import check_plant
from agvbench.simulator.plant_loading import CheckedFactory, load_plant, seed_samples_vehicle
from agvbench.simulator.plants import (
    differential_plant,
    make_plant,
    random_differential_plant,
    random_plant,
    small_plant,
)
from agvbench.types import Plant, PlantFactory

CameraNoise = Camera  # the name by which adapters know it

__all__ = [
    "Camera",
    "CameraNoise",
    "CheckedFactory",
    "CheckedPlant",
    "Plant",
    "PlantFactory",
    "Tracker",
    "check_plant",
    "differential_plant",
    "load_plant",
    "make_plant",
    "random_differential_plant",
    "random_plant",
    "seed_samples_vehicle",
    "small_plant",
]
