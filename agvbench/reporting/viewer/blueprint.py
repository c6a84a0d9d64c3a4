"""The layout of the Rerun viewer: all runs on one floor, and a tab for each trajectory, condition and run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from agvbench.reporting.viewer.run_entities import FAULTS, FLOOR, Place

LIVE = "/live"
_MOST_TABS = 20


def blueprint(places: Iterable[Place], *, live: bool = False) -> Any:
    """Return the layout of the runs at `places`; `live` begins with the vehicle as it drives now."""
    import rerun.blueprint as rrb

    everything = rrb.Spatial3DView(origin="/", contents=[f"{FLOOR}/**", "/runs/**"], name="All runs")
    tabs: dict[str, dict[str, list[Place]]] = {}
    for place in places:
        tabs.setdefault(place.trajectory, {}).setdefault(place.condition, []).append(place)
    inside = [
        rrb.Tabs(*(rrb.Tabs(*_views(runs), name=condition) for condition, runs in conditions.items()), name=trajectory)
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


def _views(places: Sequence[Place]) -> list[Any]:
    """Return a tab for each run of a condition, or one for all of them where they are many: tabs stand side by side."""
    if len(places) <= _MOST_TABS:
        return [_one_run(place) for place in places]
    import rerun.blueprint as rrb

    runs = places[0].entity.rpartition("/")[0]
    return [rrb.Spatial3DView(origin="/", contents=[f"{FLOOR}/**", f"{runs}/**"], name=f"{len(places)} runs")]


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
