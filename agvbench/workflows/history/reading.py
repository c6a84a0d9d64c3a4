"""``agvbench.history``: read every campaign below a folder, and find the steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from agvbench.campaign.names import as_texts
from agvbench.errors import AgvbenchError, CampaignError, FlagError, InputError, OneOf
from agvbench.metrics.registry import all_metrics
from agvbench.statistics.end_poses import in_order
from agvbench.statistics.steps.change_points import ORDERS, ChangePoint, ChangePoints, find_steps
from agvbench.types import Floats
from agvbench.workflows.history.cache import CampaignCache, ReadCampaign
from agvbench.workflows.history.facts import Facts, changed, facts_of
from agvbench.workflows.history.folders import campaigns_below
from agvbench.workflows.history.nights import Nights, named, nights_of
from agvbench.workflows.history.result import History

if TYPE_CHECKING:
    import pandas as pd

ALPHA = 0.05
Track = Callable[[Iterable[Path], int], Iterable[Path]]
"""Wraps the directories while they are read, to show progress: called with them and their number."""


def history(
    folder: str | Path,
    *,
    metrics: str | Collection[str] | None = None,
    conditions: str | Collection[str] | None = None,
    alpha: float = ALPHA,
    track: Track | None = None,
) -> History:
    """Return the history of every campaign below `folder`: nightly values of each metric, and the steps in them.

    A night is a campaign. They are ordered by when their sessions began, as the table ``provenance`` says; else by the
    date in the directory's name, else by the modification time of ``campaign.toml``. A campaign that cannot be read
    is listed in ``History.unread``. One without ``errors.parquet`` is evaluated, and keeps the file where its directory
    can be written.

    Parameters
    ----------
    folder
        Where to look for campaigns, at any depth; symbolic links are not followed.
    metrics, conditions
        The names of those that count; by default all.
    alpha
        The chance of any false step, over all metrics and conditions together, from 0.01.
    track
        Wraps the directories while they are read, to show progress: called with them and their number.

    Raises
    ------
    InputError
        If `folder` is no directory, or no campaign with runs that count can be read below it.
    FlagError
        If there is no such metric or condition, or `alpha` cannot be used.
    """
    folder = Path(folder)
    least = 2.0 / (ORDERS + 1)
    if not least <= alpha < 1.0:
        raise FlagError("cannot be used", where="--alpha", value=f"{alpha:g}", limit=f"{least:g} to 1")
    read, unread = _read_all(folder, track)
    nights = _chosen(nights_of([one.cells for one in read]), metrics, conditions)
    values = nights.value
    found = find_steps(values, alpha=alpha)
    return History(
        folder=folder,
        campaigns=_campaigns(read),
        nights=_night_table(nights, read),
        series=_series_table(nights, values, found),
        changes=_change_table(nights, found, read),
        unread=tuple(unread),
        alpha=alpha,
        autocorrelation=found.autocorrelation,
    )


def _read_all(folder: Path, track: Track | None) -> tuple[list[ReadCampaign], list[str]]:
    """Return the campaigns below a folder in the order of their dates, and a line for each that cannot be read."""
    if not folder.is_dir():
        what = "is not a directory" if folder.exists() else "does not exist"
        raise InputError(what, where=folder, remedy="give a folder with campaigns")
    cache, read, unread = CampaignCache(folder), list[ReadCampaign](), list[str]()
    paths = list(campaigns_below(folder, unread.append))
    for path in track(paths, len(paths)) if track else paths:
        try:
            read.append(cache.read(path))
        except AgvbenchError as error:
            unread.append(str(error))
        except OSError as error:
            unread.append(str(CampaignError("cannot be read", where=path, value=error.strerror)))
    if not any(len(one.cells.repeats) for one in read):
        why = f" that can be read (the first: {unread[0]})" if unread else " with a run that counts" if paths else ""
        raise InputError(f"has no campaign{why}", where=folder, remedy="give a folder with campaigns")
    cache.keep(read)
    return sorted(read, key=lambda one: (one.driven.at, one.name)), unread


def _chosen(nights: Nights, metrics: str | Collection[str] | None, conditions: str | Collection[str] | None) -> Nights:
    """Return the series of these metrics and conditions, by metric in their usual order, then by condition."""
    order_of = {name: k for k, name in enumerate(all_metrics())}
    usual = {name: k for k, name in enumerate(in_order(condition for condition, _, _ in nights.series))}
    wanted = {}
    for flag, at, names in (("--condition", 0, conditions), ("--metric", 1, metrics)):
        known = sorted({kind[at] for kind in nights.series})
        wanted[at] = set(known) if names is None else as_texts(names, where=flag)
        if unknown := sorted(wanted[at].difference(known)):
            raise FlagError("no night has it", where=flag, value=unknown[0], limit=OneOf(known))
    kept = [k for k, kind in enumerate(nights.series) if all(kind[at] in names for at, names in wanted.items())]
    if not kept:
        metric, condition = (", ".join(sorted(wanted[at])) for at in (1, 0))
        raise FlagError("no night has both", where="--metric, --condition", value=f"{metric} and {condition}")
    kept.sort(key=lambda k: (order_of.get(nights.series[k][1], len(order_of)), usual[nights.series[k][0]]))
    series = tuple(nights.series[k] for k in kept)
    return Nights(series, nights.trajectories, nights.repeats[kept], nights.median[kept], nights.spread[kept])


def _campaigns(read: Sequence[ReadCampaign]) -> pd.DataFrame:
    import pandas as pd

    rows = [(k, r.name, r.driven.at, str(r.driven.by), r.vehicle, r.cells.firmware) for k, r in enumerate(read)]
    return pd.DataFrame(rows, columns=["night", "campaign", "driven", "dated_by", "vehicle", "firmware"])


def _night_table(nights: Nights, read: Sequence[ReadCampaign]) -> pd.DataFrame:
    import pandas as pd

    table = nights.table()
    driven = pd.to_datetime(pd.Series([one.driven.at for one in read]), utc=True)
    codes = table["night"].to_numpy()
    table.insert(1, "campaign", pd.Series(named([one.name for one in read], codes)))
    table.insert(2, "driven", driven.to_numpy()[codes])
    return table


def _series_table(nights: Nights, values: Floats, found: ChangePoints) -> pd.DataFrame:
    import pandas as pd

    rows = []
    repeatability = nights.repeatability
    for k, (condition, metric, unit) in enumerate(nights.series):
        seen = values[k][np.isfinite(values[k])]
        since = found.of[k][-1].night if found.of[k] else 0
        spreads = repeatability[k][np.isfinite(repeatability[k])]
        rows.append(
            {"condition": condition, "metric": metric, "unit": unit, **_described(metric), "nights": len(seen),
             "latest": float(seen[-1]), "level": float(np.nanmean(values[k][since:])), "sd": float(found.sd[k]),
             "repeatability": float(np.median(spreads)) if len(spreads) else math.nan, "steps": len(found.of[k])}
        )  # fmt: skip
    return pd.DataFrame(rows)


def _described(metric: str) -> Mapping[str, Any]:
    known = all_metrics().get(metric)
    if known is None:
        return {"title": metric.replace("_", " "), "digits": 2, "margin": 0.0}
    return {"title": known.title, "digits": known.digits, "margin": known.margin}


_CHANGE_COLUMNS = (
    *("condition", "metric", "unit", "campaign", "driven", "earliest", "earliest_driven", "latest", "latest_driven"),
    *("night", "earliest_night", "latest_night", "before", "after", "change", "sd", "facts"),
)


def _change_table(nights: Nights, found: ChangePoints, read: Sequence[ReadCampaign]) -> pd.DataFrame:
    import pandas as pd

    facts = cache(lambda night: facts_of(read[night].path, read[night].cells.firmware))
    rows = [
        (*kind, *_where(step, read), step.before, step.after, step.change, float(sd), tuple(_facts(step, read, facts)))
        for kind, steps, sd in zip(nights.series, found.of, found.sd, strict=True)
        for step in steps
    ]
    table = pd.DataFrame(rows, columns=list(_CHANGE_COLUMNS))
    size = (table["change"] / table["sd"]).abs()  # infinite where nights of a level are equal
    order = np.lexsort((-size.to_numpy(dtype=float), -table["night"].to_numpy(dtype=float)))
    return table.iloc[order].reset_index(drop=True)


def _where(step: ChangePoint, read: Sequence[ReadCampaign]) -> Iterator[Any]:
    numbers = step.night, step.earliest, step.latest
    for night in numbers:
        yield from (read[night].name, read[night].driven.at)
    yield from numbers


def _facts(step: ChangePoint, read: Sequence[ReadCampaign], facts: Callable[[int], Facts]) -> Iterator[tuple[str, str]]:
    """Yield what changed from night to night within the interval of a step, with the campaign that brought it."""
    for before, after in pairwise(range(step.last_before, step.latest + 1)):
        for phrase in changed(facts(before), facts(after)):
            yield read[after].name, phrase
