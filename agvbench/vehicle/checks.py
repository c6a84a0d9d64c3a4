"""Checks that dataclasses make of their own fields on construction."""

from __future__ import annotations

import math
from itertools import pairwise

from agvbench.errors import VehicleError


def coerce_float(instance: object, *names: str, allow_infinite: bool = False) -> None:
    """Turn the named fields of a frozen dataclass into floats.

    Raises
    ------
    VehicleError
        If a field is no number, NaN, or infinite where that is not allowed.
    """
    for name in names:
        raw = getattr(instance, name)
        try:
            value = float(raw)
        except (TypeError, ValueError):
            raise VehicleError("must be a number", where=name, value=repr(raw)) from None
        if math.isnan(value) or (math.isinf(value) and not allow_infinite):
            raise VehicleError("must be a finite number", where=name, value=value)
        object.__setattr__(instance, name, value)


def require_positive(instance: object, *names: str) -> None:
    """Raise `VehicleError` unless the named fields are greater than zero."""
    for name in names:
        value = getattr(instance, name)
        if not value > 0.0:
            raise VehicleError("must be greater than zero", where=name, value=value)


def require_ascending(instance: object, *names: str, strict: bool = True) -> None:
    """Raise `VehicleError` unless the named fields ascend in the order given."""
    for low_name, high_name in pairwise(names):
        low, high = getattr(instance, low_name), getattr(instance, high_name)
        if high < low or (strict and high == low):
            limit = f"{'more than' if strict else 'at least'} {low_name} = {low}"
            raise VehicleError("is too low", where=high_name, value=high, limit=limit)
