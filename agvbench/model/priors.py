"""Priors on parameters of effects: what a document or a separate measurement states, with its uncertainty.

::

    [priors.mocap_latency.latency_s]
    value = 0.008
    standard_deviation = 0.001
    source = "data sheet of the camera"
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from agvbench.effects import Effect, Parameter, effect_kinds
from agvbench.effects.variants import effect_variants
from agvbench.errors import VehicleError
from agvbench.vehicle.fields import check_keys, coerce_float, from_table, require_positive

_KEYS = ("value", "standard_deviation", "source")


@dataclass(frozen=True)
class Prior:
    """A Gaussian prior on a parameter of an effect of the library.

    Parameters
    ----------
    effect, parameter
        Names of the effect and of its parameter.
    value, standard_deviation
        In the unit of the parameter.
    source
        The document or measurement that states the value.

    Raises
    ------
    VehicleError
        If the effect or the parameter is unknown, the value is out of its bounds, or the standard deviation not
        positive.
    """

    effect: str
    parameter: str
    value: float
    standard_deviation: float
    source: str

    def __post_init__(self) -> None:
        coerce_float(self, "value", "standard_deviation")
        require_positive(self, "standard_deviation")
        p = _parameter(_kind(self.effect, where="effect"), self.parameter, where="parameter")
        if not p.low <= self.value <= p.high:
            limit = f"{p.low:g} … {p.high:g} {p.unit}"
            raise VehicleError("is out of bounds", where="value", value=f"{self.value:g} {p.unit}", limit=limit)
        if not self.source.strip():
            remedy = "name the document or the measurement"
            raise VehicleError("must not be empty", where="source", value=repr(self.source), remedy=remedy)

    @property
    def name(self) -> str:
        """The name of the quantity, such as ``mocap_latency.latency_s``."""
        return f"{self.effect}.{self.parameter}"

    @property
    def unit(self) -> str:
        """The unit of the parameter."""
        return self._declared.unit

    @property
    def null(self) -> float:
        """The value of the parameter in a model without the effect; ∞ for a limit."""
        return self._declared.null

    @property
    def _declared(self) -> Parameter:
        return _parameter(effect_kinds()[self.effect], self.parameter, where="parameter")


def priors_from_toml(tables: Mapping[str, Any], *, where: str = "priors") -> tuple[Prior, ...]:
    """Return the priors in the table ``priors`` of a vehicle file: by effect, then by parameter.

    Raises
    ------
    VehicleError
        If a name is unknown, a key missing, or a value out of bounds.
    """
    found = []
    for effect, parameters in tables.items():
        kind, place = _kind(effect, where=where), f"{where}.{effect}"
        for name, table in _require_table(parameters, where=place).items():
            _parameter(kind, name, where=place)
            own = _require_table(table, where=f"{place}.{name}")
            check_keys(own, _KEYS, where=f"{place}.{name}")
            found.append(from_table(Prior, {"effect": effect, "parameter": name, **own}, where=f"{place}.{name}"))
    return tuple(found)


def priors_to_toml(priors: tuple[Prior, ...]) -> dict[str, dict[str, dict[str, Any]]]:
    """Return the priors as the table ``priors`` of a vehicle file."""
    tables: dict[str, dict[str, dict[str, Any]]] = {}
    for prior in priors:
        tables.setdefault(prior.effect, {})[prior.parameter] = {key: getattr(prior, key) for key in _KEYS}
    return tables


def _require_table(value: object, *, where: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise VehicleError("must be a table", where=where, value=repr(value), remedy=f"write [{where}]")
    return value


def _kind(effect: str, *, where: str) -> type[Effect]:
    """Return the class of an effect of the library; variants share the priors of their effect."""
    kinds = effect_kinds()
    if effect in kinds:
        return kinds[effect]
    if effect in effect_variants():
        remedy = f"write the prior of {effect_variants()[effect].variant_of}, which holds for its variants"
        raise VehicleError("a variant has no prior of its own", where=where, value=effect, remedy=remedy)
    raise VehicleError("unknown effect", where=where, value=repr(effect), remedy=_suggested(effect, kinds))


def _parameter(kind: type[Effect], name: str, *, where: str) -> Parameter:
    """Return the declared parameter `name` of an effect."""
    known = {p.name: p for p in kind.parameters()}
    if name not in known:
        raise VehicleError("unknown parameter", where=where, value=repr(name), remedy=_suggested(name, known))
    if known[name].is_direction:
        remedy = "write the prior of the size only"
        raise VehicleError("a direction has no null value, and no prior", where=where, value=name, remedy=remedy)
    return known[name]


def _suggested(name: str, known: Mapping[str, object]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    return f"did you mean {close[0]}?" if close else f"known: {', '.join(known)}"


def is_limit(prior: Prior) -> bool:
    """Return whether the parameter is a limit, whose null value is infinite."""
    return math.isinf(prior.null)
