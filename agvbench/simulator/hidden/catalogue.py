"""Every effect that a plant may hide, by name."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from agvbench.errors import PlantError
from agvbench.simulator.hidden.library import LIBRARY
from agvbench.simulator.hidden.other_forms import OTHER_FORMS
from agvbench.simulator.hidden.outside import OUTSIDE
from agvbench.simulator.hidden.recipe import Recipe

CATALOGUE: Mapping[str, Recipe] = MappingProxyType({r.name: r for r in (*LIBRARY, *OTHER_FORMS, *OUTSIDE)})
NOTHING = "nothing"
AND = "_and_"


def recipes(spec: str) -> tuple[Recipe, ...]:
    """Return what a specification hides: ``"nothing"``, a name, or two as ``"steering_lag_and_lateral_slip"``.

    Raises
    ------
    PlantError
        If a name is unknown, or an effect is named twice.

    Examples
    --------
    >>> [recipe.name for recipe in recipes("steering_lag_and_slow_patch")]
    ['steering_lag', 'slow_patch']
    """
    if spec == NOTHING:
        return ()
    names = spec.split(AND)
    unknown = next((name for name in names if name not in CATALOGUE), None)
    if unknown is not None or len(set(names)) < len(names):
        raise PlantError(
            "no such hidden effect" if unknown is not None else "an effect is hidden twice", value=unknown or spec,
            limit=f"{NOTHING}, {', '.join(CATALOGUE)}; two joined by {AND}",
        )  # fmt: skip
    return tuple(CATALOGUE[name] for name in names)
