"""Units that recordings come in, as factors to SI."""

from __future__ import annotations

import difflib
import math

from agvbench.errors import InputError

LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}
ANGLE = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "turn": 2.0 * math.pi}
TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}


def factor(unit: str, units: dict[str, float], where: object) -> float:
    """Return the factor from `unit` to SI.

    >>> factor("mm", LENGTH, "columns.x")
    0.001

    Raises
    ------
    InputError
        If `unit` is not one of `units`.
    """
    if unit in units:
        return units[unit]
    close = difflib.get_close_matches(unit.lower(), units, 1)
    remedy = f"give {close[0]}" if close else "give one of these"
    raise InputError("unit is unknown", where=where, value=repr(unit), limit=", ".join(units), remedy=remedy)
