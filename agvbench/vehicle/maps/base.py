"""The interface of every static map; a module in this package that defines one adds its kind."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import cache
from types import MappingProxyType
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from agvbench.errors import OneOf, VehicleError
from agvbench.registry import classes_by_file
from agvbench.types import Floats
from agvbench.vehicle.fields import from_table, to_table

# Rounding in a caller's arithmetic may carry an output past the end of the range by this share of it.
_ROUNDING = 1e-9


class StaticMap(ABC):
    """How a command sets a steering angle or a speed once everything has settled: monotone and invertible.

    The command is in the vehicle's unit (µs of pulse width, or −1…1). The output is rad,
    counter-clockwise positive, for a steered axle and m/s, forward positive, for the drive. A map may rise or fall:
    on the thesis' vehicle, a falling pulse turns left and drives forward. A command beyond `command_range`
    acts as the end of that range, so every finite command has an output.

    A concrete map is a frozen dataclass in a file of this package; its fields are its TOML keys.
    """

    kind: ClassVar[str]

    def __call__(self, command: ArrayLike) -> Floats:
        """Return the output, in the shape of `command`."""
        return np.asarray(self._output(self._clip(command)))

    def inverse(self, output: ArrayLike) -> Floats:
        """Return the command that gives `output`, in the shape of `output`.

        Where many commands give one output, this is the centre of the stretch (a dead band), or its inner edge if it
        reaches the end of the range (an end stop, saturation): the command that strains the servo least.

        Raises
        ------
        VehicleError
            If an output is NaN or outside `output_range`.
        """
        wanted = np.asarray(output, dtype=np.float64)
        low, high = self.output_range
        slack = _ROUNDING * (high - low) if math.isfinite(high - low) else 0.0
        reachable = (wanted >= low - slack) & (wanted <= high + slack)
        if not np.all(reachable):
            value = float(wanted[~reachable].flat[0])
            raise VehicleError(
                "output is out of the map's range", value=f"{value:.6g}", limit=f"{low:.6g} … {high:.6g}"
            )
        return np.asarray(self._command(np.clip(wanted, low, high)))

    @property
    @abstractmethod
    def command_range(self) -> tuple[float, float]:
        """Lowest and highest command that still make a difference; may be infinite."""

    @property
    def output_range(self) -> tuple[float, float]:
        """Lowest and highest output that can be reached; may be infinite."""
        first, last = (float(self._output(np.asarray(end))) for end in self.command_range)
        return min(first, last), max(first, last)

    @property
    def is_rising(self) -> bool:
        """Whether a higher command gives a higher output."""
        first, last = (float(self._output(np.asarray(end))) for end in self.command_range)
        return last > first

    def to_toml(self) -> dict[str, Any]:
        """Return this map as a TOML table: its kind and its fields."""
        return {"kind": self.kind, **to_table(self)}

    @classmethod
    def from_toml(cls, table: Mapping[str, Any], *, where: str = "map") -> Self:
        """Build a map of this kind from a TOML table; the key ``kind`` may be there or not.

        Raise `VehicleError`, naming the key, if the table does not fit.
        """
        return from_table(cls, {key: value for key, value in table.items() if key != "kind"}, where=where)

    @classmethod
    @abstractmethod
    def examples(cls) -> Sequence[Self]:
        """Return maps of this kind as they occur on vehicles, rising and falling: every test of a map runs on these."""

    @abstractmethod
    def _output(self, command: Floats) -> Floats:
        """Return the output for commands inside the range."""

    @abstractmethod
    def _command(self, output: Floats) -> Floats:
        """Return the command for outputs inside the range."""

    def _clip(self, command: ArrayLike) -> Floats:
        return np.clip(np.asarray(command, dtype=np.float64), *self.command_range)


@cache
def map_kinds() -> Mapping[str, type[StaticMap]]:
    """Return every kind of map with its class, in alphabetical order."""
    kinds = {cls.kind: cls for cls in classes_by_file("agvbench.vehicle.maps", StaticMap)}  # type: ignore[type-abstract]
    return MappingProxyType(dict(sorted(kinds.items())))


def map_from_toml(table: object, *, where: str = "map") -> StaticMap:
    """Build the map that a TOML table describes; its key ``kind`` says which.

    Raises
    ------
    VehicleError
        If the kind is missing or unknown or the rest does not fit it.

    Examples
    --------
    >>> map_from_toml({"kind": "line", "slope": 0.5, "intercept": 0})
    Line(slope=0.5, intercept=0.0, command_low=-inf, command_high=inf)
    """
    if not isinstance(table, Mapping):
        raise VehicleError("must be a table", where=where, value=repr(table))
    kinds = map_kinds()
    kind: Any = table.get("kind")
    if kind is None:
        raise VehicleError("a key is missing", where=where, value="kind", remedy=f'add kind = "{next(iter(kinds))}"')
    if not isinstance(kind, str) or kind not in kinds:
        raise VehicleError("unknown kind of map", where=f"{where}.kind", value=repr(kind), limit=OneOf(kinds))
    return kinds[kind].from_toml(table, where=where)
