"""Differential vehicles that hide an effect: ``--plant agvbench.simulator.hidden.differential:wheel_lag``.

Every name of the catalogue that such a vehicle can have is a factory, and so is every pair.

Examples
--------
>>> from agvbench.simulator import load_plant
>>> plant = load_plant("agvbench.simulator.hidden.differential:nothing")(seed=1)
>>> plant.reset((0.0, 0.0, 0.0), seed=2)
>>> x, y, heading = plant.advance(0.3, 0.0, 0.0, 1.0)
>>> 0.2 < x < 0.32
True
"""

from __future__ import annotations

from collections.abc import Callable

from agvbench.errors import PlantError
from agvbench.simulator.hidden.catalogue import NOTHING, catalogue, recipes
from agvbench.simulator.hidden.plant import HiddenPlant
from agvbench.simulator.hidden.sampling import factory


def __getattr__(name: str) -> Callable[[int], HiddenPlant]:
    """Return the factory of a name or of a pair of names."""
    try:
        recipes(name, "differential")
    except PlantError:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}") from None
    return factory(name, "differential")


def __dir__() -> list[str]:
    """Return what can be asked for: the error for a misspelt plant looks here."""
    return sorted([NOTHING, *catalogue("differential")])
