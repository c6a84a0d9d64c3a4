"""`Recipe`: how one hidden effect is drawn, and how its size becomes constants of the plant."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from agvbench.simulator.hidden.truth import Change, HiddenEffect, Kind
from agvbench.types import Kinematics

Values = dict[str, float]
Constants = Callable[[Values], Values]


@dataclass(frozen=True)
class Size:
    """One number of an effect: drawn uniformly from [low, high], of either sign if `signed`.

    ``grows`` says how a stronger effect looks: +1 by a larger number, −1 by a smaller one (a rate limit), 0 not at all
    (a place, a direction, a time constant of a form). ``most`` is visible without instruments.
    """

    low: float
    high: float
    signed: bool = False
    grows: int = 1
    most: float = math.inf

    def draw(self, rng: np.random.Generator) -> float:
        """Return a value."""
        value = float(rng.uniform(self.low, self.high))
        return -value if self.signed and rng.random() < 0.5 else value

    def grown(self, value: float, factor: float) -> float:
        """Return the value of an effect that is `factor` times as strong."""
        grown = value * factor**self.grows
        return float(math.copysign(min(abs(grown), self.most), grown))


WHEN = ("begins_h", "ends_h", "time_constant_h")
"""Parameters that say when an effect holds, and not what it is."""


def _same(values: Values) -> Values:
    return dict(values)


@dataclass(frozen=True)
class Recipe:
    """One effect that a plant may hide.

    Parameters
    ----------
    name, library_name, kind, covariates, random_phase
        As in `HiddenEffect`.
    sizes
        Its parameters, by name.
    constants
        From parameters to the plant's constants; by default the names are the same.
    base
        Constants of the base vehicle that must give way: a map without end stops, say.
    absorbed
        Whether free static maps take it up by construction.
    changes
        The constants of an effect that holds in a part of the campaign only, or grows during it. The parameters that
        say when are those of `Change`.
    kinematics
        The vehicles that can have it.
    """

    name: str
    library_name: str | None
    kind: Kind
    sizes: Mapping[str, Size]
    constants: Constants = _same
    base: Values = field(default_factory=dict)
    covariates: tuple[str, ...] = ()
    absorbed: bool = False
    random_phase: bool = False
    changes: tuple[str, ...] = ()
    kinematics: tuple[Kinematics, ...] = ("two_axle",)

    def draw(self, rng: np.random.Generator) -> Values:
        """Return parameters."""
        return {name: size.draw(rng) for name, size in self.sizes.items()}

    def grown(self, values: Values, factor: float) -> Values:
        """Return the parameters of a stronger effect."""
        return {name: self.sizes[name].grown(value, factor) for name, value in values.items()}

    def change(self, values: Values) -> Change | None:
        """Return when the effect holds, or None if it always does."""
        if not self.changes:
            return None
        return Change(self.changes, **{name: values[name] for name in WHEN if name in values})

    def effect(self, values: Values) -> HiddenEffect:
        """Return what the sealed truth says of it."""
        return HiddenEffect(
            self.name, self.library_name, self.kind, dict(values), self.covariates, self.random_phase
        )  # fmt: skip


TURN = Size(-math.pi, math.pi, grows=0)
"""A direction."""
STEP = {"begins_h": Size(0.3, 0.8, grows=0)}
"""When a change begins."""
AT_ONCE_H = 1e-9
BY_CAMPAIGN_TIME = ("campaign_time_h",)


def renamed(**names: str) -> Constants:
    """Return a map of parameters to constants: ``renamed(lag_s="time_constant_s")``."""

    def constants(values: Values) -> Values:
        return {constant: values[parameter] for constant, parameter in names.items()}

    return constants


def library_effect(
    name: str, sizes: dict[str, Size], absorbed: bool = False, base: Values | None = None, /, **names: str
) -> Recipe:  # fmt: skip
    """Return an effect with the equation of the library."""
    return Recipe(name, name, "library", sizes, renamed(**names), base or {}, absorbed=absorbed)


def other_form(name: str, library_name: str, sizes: dict[str, Size], /, **names: str) -> Recipe:
    """Return an effect of the library with another equation."""
    return Recipe(name, library_name, "other form", sizes, renamed(**names))


def outside_cause(
    name: str, covariates: tuple[str, ...], sizes: dict[str, Size], random_phase: bool = False, /, **names: str
) -> Recipe:
    """Return a cause that the library does not have."""
    return Recipe(
        name, None, "outside", sizes, renamed(**names), covariates=covariates, random_phase=random_phase
    )  # fmt: skip


def changing_cause(
    name: str, changes: tuple[str, ...], sizes: dict[str, Size], fixed: Values | None = None, /, **names: str
) -> Recipe:
    """Return a cause outside the library that changes constants with the time of the session."""
    constants = renamed(**names)
    return Recipe(
        name, None, "outside", sizes, lambda values: constants(values) | (fixed or {}),
        covariates=BY_CAMPAIGN_TIME, changes=changes,
    )  # fmt: skip


def of_either(recipe: Recipe) -> Recipe:
    """Return the recipe of an effect that vehicles of either kind may have, with the same equation."""
    return replace(recipe, kinematics=("two_axle", "differential"))


def of_differential(*recipes: Recipe) -> tuple[Recipe, ...]:
    """Return recipes of effects that only a differential vehicle may have."""
    return tuple(replace(recipe, kinematics=("differential",)) for recipe in recipes)
