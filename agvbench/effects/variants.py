"""Variants: other equations for effects of the library, whose names they keep in a diagnosis; one per file."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import ClassVar

from agvbench.effects.base import Effect
from agvbench.registry import classes_in_folders


@dataclass(frozen=True)
class Variant(Effect, ABC):
    """Another equation for the effect ``variant_of`` of the library; vehicle files contain its own name.

    A variant with an exponent represents a family of equations. A diagnosis starts from the library's exponent.

    Attributes
    ----------
    variant_of
        The effect of the library.
    equivalents
        The library's parameters, as ``effect.parameter``, that are weighted sums of the variant's own: the weights by
        name. A prior on such a parameter holds for the sum. Parameters of the same name need no entry.
    """

    variant_of: ClassVar[str]
    equivalents: ClassVar[Mapping[str, Mapping[str, float]]] = MappingProxyType({})

    @classmethod
    @abstractmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Return initial values of a fit, given the library's parameters by name."""


@cache
def effect_variants() -> Mapping[str, type[Variant]]:
    """Return every variant by its name, in alphabetical order."""
    found = classes_in_folders("agvbench.effects", Variant)  # type: ignore[type-abstract]
    return MappingProxyType({cls.name: cls for cls in sorted(found, key=lambda cls: cls.name)})


def cause_of(name: str) -> str:
    """Return the name of the effect that `name` is a variant of, or `name` itself."""
    variant = effect_variants().get(name)
    return name if variant is None else variant.variant_of


def causes_in(variant: type[Variant]) -> frozenset[str]:
    """Return the effects of the library that a variant combines: the one that it is a variant of, and its equivalents.

    Examples
    --------
    >>> sorted(causes_in(effect_variants()["marker_offset_wheelbase"]))
    ['marker_offset', 'wheelbase_error']
    """
    return frozenset({variant.variant_of, *(quantity.partition(".")[0] for quantity in variant.equivalents)})


def weights_in(name: str, quantity: str) -> Mapping[str, float]:
    """Return the weights of the parameters of the effect or variant `name` in a `quantity` of the library.

    Examples
    --------
    >>> weights_in("mocap_latency", "mocap_latency.latency_s")
    {'latency_s': 1.0}
    >>> weights_in("actuation_delay_servos", "actuation_delay.delay_s")
    {'steering_s': 0.5, 'drive_s': 0.5}
    >>> weights_in("steering_lag", "mocap_latency.latency_s")
    {}
    """
    variant = effect_variants().get(name)
    if variant is not None and quantity in variant.equivalents:
        return dict(variant.equivalents[quantity])
    effect, _, parameter = quantity.partition(".")
    if cause_of(name) != effect or (variant and parameter not in {p.name for p in variant.parameters()}):
        return {}
    return {parameter: 1.0}
