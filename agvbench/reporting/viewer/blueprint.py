"""The layout of the Rerun viewer: all runs on one floor, and a tab for each trajectory, condition and run."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from agvbench.reporting.viewer.run_entities import FAULTS, FLOOR, Place

LIVE = "/live"


def blueprint(places: Iterable[Place], *, live: bool = False) -> Any:
    """Return the layout of the runs at `places`; `live` begins with the vehicle as it drives now."""
    import rerun.blueprint as rrb

    everything = rrb.Spatial3DView(origin="/", contents=[f"{FLOOR}/**", "/runs/**"], name="All runs")
    tabs: dict[str, dict[str, list[Any]]] = {}
    for place in places:
        tabs.setdefault(place.trajectory, {}).setdefault(place.condition, []).append(_one_run(place))
    inside = [
        rrb.Tabs(*(rrb.Tabs(*views, name=condition) for condition, views in conditions.items()), name=trajectory)
        for trajectory, conditions in tabs.items()
    ]
    first = [_now()] if live else []
    faults = rrb.TextLogView(origin=FAULTS, name="Faults")
    return rrb.Blueprint(rrb.Tabs(*first, everything, *inside, faults), collapse_panels=True)


def _now() -> Any:
    import rerun.blueprint as rrb

    floor = rrb.Spatial3DView(origin="/", contents=[f"{FLOOR}/**", f"{LIVE}/**", "/runs/**"], name="Floor")
    commands = rrb.TimeSeriesView(origin=LIVE, contents=[f"{LIVE}/command"], name="Commands")
    log = rrb.TextLogView(origin=LIVE, contents=[f"{LIVE}/phase", f"{FAULTS}/**"], name="Phases and faults")
    return rrb.Vertical(floor, rrb.Horizontal(commands, log), row_shares=[3, 1], name="Now")


def _one_run(place: Place) -> Any:
    import rerun.blueprint as rrb

    entity = place.entity
    return rrb.Vertical(
        rrb.Spatial3DView(origin="/", contents=[f"{FLOOR}/**", f"{entity}/**"], name="Floor"),
        rrb.TimeSeriesView(origin=entity, contents=[f"{entity}/residual"], name="Residual"),
        rrb.TimeSeriesView(origin=entity, contents=[f"{entity}/commands"], name="Commands"),
        row_shares=[3, 1, 1],
        name=place.run,
    )
