"""What another law of a cause declares, and how it is found: one file each, beside this one."""

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
    """The cause that the library calls ``variant_of``, with another law; in vehicle files it has its own name.

    A law with an exponent of its own stands for many: the library's is the one at which a diagnosis begins.
    """

    variant_of: ClassVar[str]

    @classmethod
    @abstractmethod
    def starts(cls, fitted: Mapping[str, float]) -> list[tuple[float, ...]]:
        """Return parameters to begin a fit with, given those of the library's law by name."""


@cache
def effect_variants() -> Mapping[str, type[Variant]]:
    """Return every other law by its own name, in alphabetical order."""
    found = {cls.name: cls for cls in classes_by_file("agvbench.effects.variants", Variant)}  # type: ignore[type-abstract]
    return MappingProxyType(dict(sorted(found.items())))


def cause_of(name: str) -> str:
    """Return what the library calls the cause whose law is called `name`."""
    variant = effect_variants().get(name)
    return name if variant is None else variant.variant_of
