"""What changed since the campaign before: firmware, calibration, adapter, settings, files, labels, and medians."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from agvbench.campaign import Campaign
from agvbench.campaign.header import FILE_NAME, CampaignHeader
from agvbench.errors import AgvbenchError, CampaignError
from agvbench.metrics.table import COLUMNS, metric_table, read_metrics
from agvbench.types import RUN_OK
from agvbench.workflows.history.facts import differences, facts_of
from agvbench.workflows.history.folders import dated

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class CampaignChanges:
    """What differs from the campaign before.

    ``driven`` is when it was driven (UTC), ``differences`` are name, value then and value now of each fact that
    differs. ``medians`` has a row for each metric and condition of both: ``metric``, ``unit``, ``condition``, and of
    the trajectories that both drove the ``runs`` and the ``median`` of absolute values, ``_before`` and ``_now``.
    """

    before: Path
    driven: datetime
    differences: Sequence[tuple[str, str, str]]
    medians: pd.DataFrame


def changes_since_before(
    campaign: Path, against: Path | None = None, *, firmware: str | None = None, metrics: pd.DataFrame | None = None
) -> CampaignChanges | None:
    """Return what differs from the campaign `against`, or else from the last one of this vehicle in the same folder.

    None where there is no earlier one. Campaigns that cannot be read are passed over, but for `against`. `firmware` is
    what `firmware_of` returns of the campaign's runs, and `metrics` what `metric_table` does; without them the
    campaign is read.

    Raises
    ------
    CampaignError
        If there is no campaign in `against`.
    """
    if against is not None and not (against / FILE_NAME).is_file():
        raise CampaignError(
            "is no campaign", where="--against", value=against, remedy="give a directory with campaign.toml"
        )
    before = against or _before(campaign)
    if before is None:
        return None
    now = facts_of(campaign, _firmware(campaign) if firmware is None else firmware)
    differing = tuple(differences(facts_of(before, _firmware(before)), now))
    measured = _metrics(campaign) if metrics is None else metrics
    return CampaignChanges(before, dated(before).at, differing, medians_before_and_now(_metrics(before), measured))


def medians_before_and_now(before: pd.DataFrame, now: pd.DataFrame) -> pd.DataFrame:
    """Return the table that `CampaignChanges` keeps as ``medians``, of what `metric_table` returned for both."""
    common = set(before["trajectory"]) & set(now["trajectory"])
    sides = (_medians(side[side["trajectory"].isin(common)]) for side in (before, now))
    was, is_now = (side.set_index(["metric", "unit", "condition"]) for side in sides)
    return was.add_suffix("_before").join(is_now.add_suffix("_now"), how="inner").reset_index()


def _medians(table: pd.DataFrame) -> pd.DataFrame:
    counted = table[table["status"] == RUN_OK]
    grouped = counted.assign(value=counted["value"].abs()).groupby(["metric", "unit", "condition"], sort=False)
    return grouped["value"].agg(runs="size", median="median").reset_index()


def _metrics(campaign: Path) -> pd.DataFrame:
    """Return the metrics of a campaign; an empty table where it cannot be read."""
    import pandas as pd

    with suppress(AgvbenchError):
        kept = read_metrics(campaign)
        return metric_table(campaign) if kept is None else kept
    return pd.DataFrame(columns=list(COLUMNS))


def firmware_of(names: Iterable[str]) -> str:
    """Return the firmware that runs name, several with commas, in the order of the runs."""
    return ", ".join(dict.fromkeys(str(name) for name in names if name))


def _before(campaign: Path) -> Path | None:
    """Return the last campaign of the same vehicle that was driven before this one, in the same folder."""
    try:
        now, vehicle = dated(campaign).at, CampaignHeader.load(campaign / FILE_NAME).vehicle_name
        earlier = sorted((at, path) for at, path in _beside(campaign) if at < now)
    except (OSError, AgvbenchError):
        return None
    for _, path in reversed(earlier):
        try:
            if CampaignHeader.load(path / FILE_NAME).vehicle_name == vehicle:
                return path
        except AgvbenchError:
            continue
    return None


def _beside(campaign: Path) -> Iterator[tuple[datetime, Path]]:
    own = campaign.resolve()
    for path in sorted(own.parent.iterdir()):
        if path != own and (path / FILE_NAME).is_file():
            yield dated(path).at, campaign.parent / path.name


def _firmware(campaign: Path) -> str:
    """Return the firmware that the runs of a campaign name, several with commas; "" where they cannot be read."""
    try:
        return firmware_of(Campaign.open(campaign).runs["firmware"])
    except AgvbenchError:
        return ""
