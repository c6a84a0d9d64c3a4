"""What changed since the campaign before: firmware, calibration, adapter, settings, files, labels."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from agvbench.campaign import Campaign
from agvbench.campaign.header import FILE_NAME, CampaignHeader
from agvbench.errors import AgvbenchError, CampaignError
from agvbench.workflows.history.facts import differences, facts_of
from agvbench.workflows.history.folders import dated


@dataclass(frozen=True)
class CampaignChanges:
    """The campaign before, when it was driven (UTC), and name, value then and value now of each fact that differs."""

    before: Path
    driven: datetime
    differences: Sequence[tuple[str, str, str]]


def changes_since_before(
    campaign: Path, against: Path | None = None, *, firmware: str | None = None
) -> CampaignChanges | None:
    """Return what differs from the campaign `against`, or else from the last one of this vehicle in the same folder.

    None where there is no earlier one. Campaigns that cannot be read are passed over, but for `against`. `firmware` is
    what `firmware_of` returns of the campaign's runs; without it they are read.

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
    return CampaignChanges(before, dated(before).at, tuple(differences(facts_of(before, _firmware(before)), now)))


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
