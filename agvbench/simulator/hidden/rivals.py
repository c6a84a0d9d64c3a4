"""True rivals: what other effects of the library would move the reference drives in just the same way."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from agvbench.simulator.hidden.library import LIBRARY
from agvbench.simulator.hidden.recipe import Recipe
from agvbench.simulator.hidden.separation import Bench, fit_mechanism
from agvbench.simulator.hidden.truth import SealedTruth
from agvbench.simulator.hidden.vehicle import BaseVehicle

INDISTINGUISHABLE = 1.0
"""A rival leaves less than this [floors] of what an effect leaves when static maps alone are refitted."""


def true_rivals(base: BaseVehicle, truth: SealedTruth, *, limit: float = INDISTINGUISHABLE) -> dict[str, float]:
    """Return the library's effects that explain the reference drives of a plant with one hidden effect.

    Each is fitted to the plant's own paths together with every level of the static maps, by driving base plants.

    Parameters
    ----------
    base
        The plant's vehicle.
    truth
        What it hides.
    limit
        What a rival may leave [floors].

    Returns
    -------
    Name to what it leaves [floors], the best first, without the hidden effect itself.
    """
    names = set(truth.library_names)
    bench = Bench(base, {k: v for k, v in truth.constants.items() if k in base.constants})
    mechanism = {k: v for k, v in truth.constants.items() if k not in base.constants}
    wanted = np.concatenate(bench.paths(mechanism))
    left = {
        recipe.name: fit_recipe(bench, wanted, recipe) / bench.floor_m for recipe in LIBRARY if recipe.name not in names
    }
    return {name: rest for name, rest in sorted(left.items(), key=lambda item: item[1]) if rest < limit}


def fit_recipe(bench: Bench, wanted: np.ndarray, recipe: Recipe) -> float:
    """Return the rms [m] that the best size of an effect leaves, begun from a small and, if signed, a negative one."""
    names = list(recipe.sizes)

    def constants(values: Sequence[float]) -> dict[str, float]:
        return recipe.constants(dict(zip(names, values, strict=True)))

    starts = [[_typical(recipe, name) for name in names]]
    return min(fit_mechanism(bench, wanted, _within(constants, names), start) for start in starts)


def _typical(recipe: Recipe, name: str) -> float:
    size = recipe.sizes[name]
    middle = 0.5 * (size.low + size.high)
    return middle if middle else 0.5 * size.high


_POSITIVE = ("_s", "rate_rad_per_s", "width", "width_rad", "front_rad", "rear_rad")


def _within(
    constants: Callable[[Sequence[float]], dict[str, float]], names: Sequence[str]
) -> Callable[[Sequence[float]], dict[str, float]]:
    """Keep times, rates and widths from turning negative on the way."""

    def bounded(values: Sequence[float]) -> dict[str, float]:
        kept = [max(1e-4, v) if n.endswith(_POSITIVE) else v for n, v in zip(names, values, strict=True)]
        return constants(kept)

    return bounded
