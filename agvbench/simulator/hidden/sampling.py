"""`make_hidden_plant`: a randomly sampled quiet vehicle, hiding effects large enough to be found."""

from __future__ import annotations

import functools
import math
import zlib
from collections.abc import Callable

import numpy as np

from agvbench.simulator.hidden.base_vehicle import BaseVehicle, sample_differential, sample_vehicle
from agvbench.simulator.hidden.catalogue import AND, CATALOGUE, LATER, NOTHING, recipes
from agvbench.simulator.hidden.plant import HiddenPlant
from agvbench.simulator.hidden.recipe import Recipe, Values
from agvbench.simulator.hidden.separation import Separation, SeparationStudy, separation
from agvbench.simulator.hidden.truth import HiddenEffect, Kind, SealedTruth
from agvbench.simulator.random_streams import random_stream
from agvbench.types import Kinematics

FLOORS = 3.0
"""What a hidden effect leaves at least on the reference drives."""
_GROWTH, _MOST_GROWTHS = 1.3, 6
_SEEDS = 2**64


def make_hidden_plant(
    spec: str, seed: int, *, floors: float = FLOORS, kinematics: Kinematics = "two_axle"
) -> HiddenPlant:
    """Return a plant that hides what `spec` says.

    Parameters
    ----------
    spec
        ``"nothing"``, a name of the catalogue, or two joined by ``"_and_"``.
    seed
        Draws vehicle, sizes and play; the vehicle is the same for every specification.
    floors
        What each effect leaves at least on the reference drives [floors]; 0 takes the sizes as they are drawn and
        measures nothing, which saves seconds.
    kinematics
        What kind of vehicle it is.

    Raises
    ------
    PlantError
        If a name is unknown, or such a vehicle cannot have the effect.

    Examples
    --------
    >>> plant = make_hidden_plant("nothing", 3)
    >>> plant.sealed_truth().effects
    ()
    """
    base, truth = _sampled(spec, seed % _SEEDS, floors, kinematics)
    return HiddenPlant(dict(truth.constants), base.run_variation, seed, truth)


def vehicle_of(seed: int, kinematics: Kinematics = "two_axle") -> BaseVehicle:
    """Return the vehicle that all plants of a seed share, whatever they hide."""
    if kinematics == "differential":
        return sample_differential(random_stream(0xD1FFBA5E, seed))
    return sample_vehicle(random_stream(0xBA5E, seed))


def sampled_spec(seed: int) -> str:
    """Return what `make_plant` hides for a seed: nothing in a fifth of cases, two effects in a fifth, else one."""
    rng = random_stream(0x5EA1, seed)
    # Effects that change, and others, came later: what earlier seeds drew has been published.
    later = {recipe.name for recipe in LATER}
    share, names = rng.random(), [n for n, recipe in CATALOGUE.items() if not recipe.changes and n not in later]
    if share < 0.2:
        return NOTHING
    chosen = rng.choice(len(names), size=2, replace=False)
    first, second = (names[int(i)] for i in chosen)
    related = CATALOGUE[first].library_name == CATALOGUE[second].library_name is not None
    return first if share < 0.8 or related else f"{first}{AND}{second}"


def factory(spec: str, kinematics: Kinematics = "two_axle") -> Callable[[int], HiddenPlant]:
    """Return a plant factory for a specification, as ``--plant`` wants it."""
    recipes(spec, kinematics)

    def make(seed: int) -> HiddenPlant:
        """Return a plant."""
        return make_hidden_plant(spec, seed, kinematics=kinematics)

    make.__name__ = make.__qualname__ = spec
    return make


@functools.lru_cache(maxsize=256)
def _sampled(spec: str, seed: int, floors: float, kinematics: Kinematics) -> tuple[BaseVehicle, SealedTruth]:
    base = vehicle_of(seed, kinematics)
    hidden = recipes(spec, kinematics)
    override = {name: value for recipe in hidden for name, value in recipe.base.items()}
    if not hidden:
        return base, SealedTruth("nothing", constants=base.constants)
    bench = _bench(seed, tuple(override.items()), kinematics) if floors > 0.0 else None
    sizes = {recipe.name: _large_enough(bench, recipe, seed, floors) for recipe in hidden}
    mechanism = {k: v for recipe in hidden for k, v in recipe.constants(sizes[recipe.name]).items()}
    found = Separation(math.nan, math.nan, math.nan) if bench is None else separation(bench, mechanism)
    effects = tuple(recipe.effect(sizes[recipe.name]) for recipe in hidden)
    return base, SealedTruth(
        _kind(effects), effects, found.refitted, found.held, found.floor_m,
        any(recipe.absorbed for recipe in hidden), base.constants | override | mechanism,
        tuple(change for recipe in hidden if (change := recipe.change(sizes[recipe.name])) is not None),
    )  # fmt: skip


@functools.lru_cache(maxsize=4)
def _bench(seed: int, override: tuple[tuple[str, float], ...], kinematics: Kinematics) -> SeparationStudy:
    return SeparationStudy(vehicle_of(seed, kinematics), dict(override))


def _kind(effects: tuple[HiddenEffect, ...]) -> Kind:
    return effects[0].kind if len(effects) == 1 else "two"


def _large_enough(bench: SeparationStudy | None, recipe: Recipe, seed: int, floors: float) -> Values:
    """Draw an effect's parameters; let it grow until it leaves `floors`, or is 1.3⁶ ≈ 4.8 times as strong."""
    values = recipe.draw(np.random.default_rng([zlib.crc32(recipe.name.encode()), seed]))
    for _ in range(_MOST_GROWTHS):
        if bench is None or _counts(separation(bench, recipe.constants(values)), recipe) >= floors:
            break
        values = recipe.grown(values, _GROWTH)
    return values


def _counts(found: Separation, recipe: Recipe) -> float:
    """Return the separation that counts: with the maps held where they would absorb it."""
    return found.held if recipe.absorbed or recipe.changes else found.refitted
