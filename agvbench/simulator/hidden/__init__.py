"""Plants that hide an effect: for blind trials of a diagnosis.

Every name of the catalogue is a factory for the command line, and so is every pair:
``--plant agvbench.simulator.hidden:steering_lag``, ``…:steering_lag_and_lateral_slip``, ``…:nothing``.
``…:make_plant`` draws one by its seed. Differential vehicles are those of `agvbench.simulator.hidden.differential`.

Examples
--------
>>> from agvbench.simulator import load_plant
>>> plant = load_plant("agvbench.simulator.hidden:nothing")(seed=1)
>>> plant.reset((0.0, 0.0, 0.0), seed=2)
>>> x, y, heading = plant.advance(900.0, 1500.0, 1500.0, 1.0)
>>> 0.2 < x < 0.4
True
"""

from __future__ import annotations

from collections.abc import Callable

from agvbench.errors import PlantError
from agvbench.simulator.hidden.base_vehicle import BaseVehicle, sample_vehicle
from agvbench.simulator.hidden.catalogue import CATALOGUE, NOTHING, recipes
from agvbench.simulator.hidden.plant import HiddenPlant
from agvbench.simulator.hidden.sampling import factory, make_hidden_plant, sampled_spec, vehicle_of
from agvbench.simulator.hidden.separation import Separation, SeparationStudy, indistinguishable_effects, separation
from agvbench.simulator.hidden.truth import HiddenEffect, SealedTruth
from agvbench.types import Kinematics

__all__ = [
    "CATALOGUE",
    "BaseVehicle",
    "HiddenEffect",
    "HiddenPlant",
    "SealedTruth",
    "Separation",
    "SeparationStudy",
    "indistinguishable_effects",
    "make_hidden_plant",
    "make_plant",
    "sample_vehicle",
    "sealed_truth",
    "separation",
    "vehicle_of",
]


def make_plant(seed: int) -> HiddenPlant:
    """Return a plant that hides what its seed draws: nothing, one effect or two."""
    return make_hidden_plant(sampled_spec(seed), seed)


def sealed_truth(spec: str, seed: int, kinematics: Kinematics = "two_axle") -> SealedTruth:
    """Return what the plant of a specification and seed hides; for scoring."""
    return make_hidden_plant(spec, seed, kinematics=kinematics).sealed_truth()


def __getattr__(name: str) -> Callable[[int], HiddenPlant]:
    """Return the factory of a name or of a pair of names."""
    try:
        recipes(name)
    except PlantError:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}") from None
    return factory(name)


def __dir__() -> list[str]:
    """Return what can be asked for: the error for a misspelt plant looks here."""
    return sorted([*__all__, NOTHING, *CATALOGUE])
