"""The base class of variants, one per file of this package, and their registry."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import ClassVar

from agvbench.effects.base import Effect
from agvbench.registry import classes_by_file


@dataclass(frozen=True)
class Variant(Effect, ABC):
    """Another equation for the effect ``variant_of`` of the library; vehicle files contain its own name.

    A variant with an exponent represents a family of equations. A diagnosis starts from the library's exponent.
    """

    variant_of: ClassVar[str]

    @classmethod
    @abstractmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Return initial values of a fit, given the library's parameters by name."""


@cache
def effect_variants() -> Mapping[str, type[Variant]]:
    """Return every variant by its name, in alphabetical order."""
    found = {cls.name: cls for cls in classes_by_file("agvbench.effects.variants", Variant)}  # type: ignore[type-abstract]
    return MappingProxyType(dict(sorted(found.items())))


def cause_of(name: str) -> str:
    """Return the name of the effect that `name` is a variant of, or `name` itself."""
    variant = effect_variants().get(name)
    return name if variant is None else variant.variant_of
