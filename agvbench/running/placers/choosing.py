"""From the option ``--place`` to a placer."""

from __future__ import annotations

from collections.abc import Mapping

from agvbench.errors import FlagError
from agvbench.running.placers.auto import Auto
from agvbench.running.placers.operator import Operator
from agvbench.running.placers.placer import Placer, Rig
from agvbench.running.placers.teleport import Teleport

PLACERS: Mapping[str, type[Placer]] = {"auto": Auto, "operator": Operator, "teleport": Teleport}


def choose_placer(name: str, *, simulated: bool) -> type[Placer]:
    """Return the placer called `name`; where that is empty, the usual one.

    Raises
    ------
    FlagError
        If it cannot place such a vehicle.
    """
    usable = [n for n, placer in PLACERS.items() if (placer.places_simulated if simulated else placer.places_real)]
    chosen = name or ("teleport" if simulated else "operator")
    if chosen not in usable:
        vehicle = "a simulated vehicle" if simulated else "a real vehicle"
        raise FlagError(f"{vehicle} cannot be placed so", where="--place", value=chosen, limit=" or ".join(usable))
    return PLACERS[chosen]


def make_placer(name: str, rig: Rig) -> Placer:
    """Return the placer called `name` with the vehicle of `rig`; errors are those of `choose_placer`."""
    return choose_placer(name, simulated=rig.link.identity().simulated)(rig)
