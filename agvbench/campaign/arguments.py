"""Arguments of the Python API: a campaign or its directory, and runs; errors say what to give instead."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from os import PathLike
from pathlib import Path
from typing import Protocol, TypeVar

from agvbench.campaign.campaign import Campaign
from agvbench.errors import InputError
from agvbench.types import Run


class WithHeader(Protocol):
    """What has the header of a campaign."""

    @property
    def header(self) -> object:
        """What holds for all runs."""


C = TypeVar("C", bound=WithHeader)
_OPEN = 'agvbench.Campaign.open("DIRECTORY"), or the directory'


def as_campaign(source: C | str | PathLike[str], *, where: str = "campaign") -> C | Campaign:
    """Return the campaign in a directory, or `source` if it is a campaign.

    Raises
    ------
    InputError
        If `source` is neither; `where` is the argument's name.
    CampaignError
        If there is no campaign in the directory.
    """
    if isinstance(source, str | PathLike):
        return Campaign.open(Path(source))
    if not hasattr(source, "header"):
        raise InputError("is not a campaign", where=where, value=type(source).__name__, remedy=f"give {_OPEN}")
    return source


def as_runs(source: Iterable[Run] | Run | str | PathLike[str], *, where: str = "runs") -> Iterable[Run]:
    """Return the runs of a campaign, of the campaign in a directory, of an iterable, or a run alone.

    Raises
    ------
    InputError
        If `source` is none of these, at once or when the iteration meets what is no run.
    CampaignError
        If there is no campaign in the directory.
    """
    if isinstance(source, Campaign | str | PathLike):
        return as_campaign(source)
    if isinstance(source, Run):
        return [source]
    if not isinstance(source, Iterable):
        raise _not_runs(source, where)
    return _runs_only(source, where)


def _runs_only(source: Iterable[object], where: str) -> Iterator[Run]:
    for item in source:
        if not isinstance(item, Run):
            raise _not_runs(source, where)
        yield item


def _not_runs(source: object, where: str) -> InputError:
    remedy = f"give runs from campaign.select, or {_OPEN}"
    return InputError("are not runs", where=where, value=type(source).__name__, remedy=remedy)
