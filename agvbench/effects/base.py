"""What every effect declares."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, ClassVar, Self

from agvbench.errors import VehicleError
from agvbench.vehicle.checks import coerce_float
from agvbench.vehicle.tables import from_table, to_table


class Stage(StrEnum):
    """Where in the chain from command to measured pose an effect acts; the chain is in this order."""

    TRANSPORT = "transport"
    ACTUATOR = "actuator"
    WHEELS = "wheels"
    BODY = "body"
    FLOOR = "floor"
    CAMERA = "camera"


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    Parameters
    ----------
    name
        Field of the effect, key in TOML.
    unit
        SI unit, ``"–"`` for a ratio.
    null
        The value at which the effect does nothing (∞ for a limit).
    low, high
        The values that make sense: what a file may say and a fit may search.
    """

    name: str
    unit: str
    null: float
    low: float
    high: float


def parameter(*, unit: str, low: float, high: float, null: float = 0.0) -> Any:
    """Declare a field of an effect; its default is its null value. See `Parameter`."""
    return dataclasses.field(default=null, metadata={"unit": unit, "null": null, "low": low, "high": high})


@dataclass(frozen=True)
class Effect:
    """One physical cause that a vehicle model may have or lack.

    A concrete effect is a frozen dataclass in a file of this package; each field is a `parameter`, and an
    effect made without arguments does nothing. What it does is in its docstring as an equation;
    `agvbench.model` simulates it.

    Attributes
    ----------
    name
        The name in files and verdicts.
    stage
        Where it acts.
    relaxes
        The assumption of the thesis (sections 3.2, 7.3, 9.2) that does not hold if the effect is there.
    reference
        Where the equation comes from.
    """

    name: ClassVar[str]
    stage: ClassVar[Stage]
    relaxes: ClassVar[str]
    reference: ClassVar[str]

    def __post_init__(self) -> None:
        for p in self.parameters():
            coerce_float(self, p.name, allow_infinite=math.isinf(p.null))
            value = getattr(self, p.name)
            if value != p.null and not p.low <= value <= p.high:
                limit = f"{p.low:g} … {p.high:g} {p.unit}"
                raise VehicleError("is out of bounds", where=p.name, value=f"{value:g} {p.unit}", limit=limit)

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """Return the declared parameters, in order."""
        return tuple(Parameter(name=f.name, **f.metadata) for f in dataclasses.fields(cls))

    @property
    def values(self) -> Mapping[str, float]:
        """The parameters' values by name."""
        return to_table(self)

    @property
    def is_null(self) -> bool:
        """Whether every parameter is at the value that does nothing."""
        return all(getattr(self, p.name) == p.null for p in self.parameters())

    def to_toml(self) -> dict[str, Any]:
        """Return this effect as a TOML table: its name and its parameters."""
        return {"name": self.name, **to_table(self)}

    @classmethod
    def from_toml(cls, table: Mapping[str, Any], *, where: str = "effect") -> Self:
        """Build this effect from a TOML table; the key ``name`` may be there or not.

        Raises
        ------
        VehicleError
            If a parameter is unknown, no number or out of bounds.
        """
        return from_table(cls, {key: value for key, value in table.items() if key != "name"}, where=where)
