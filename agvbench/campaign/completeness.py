"""Which of the runs that a campaign planned were driven."""

from __future__ import annotations

import re
from dataclasses import dataclass

from agvbench.campaign.campaign import Campaign
from agvbench.campaign.manifest import PLANNED_TABLE
from agvbench.types import RUN_OK

_ATTEMPT = re.compile(r"(-attempt\d+)?(-aborted\d+)?$")
_SHOWN = 3


def planned_id(run_id: str) -> str:
    """Return the id of the planned run that the recorded run `run_id` is an attempt at.

    >>> planned_id("left-r01-attempt2-aborted1")
    'left-r01'
    """
    return _ATTEMPT.sub("", run_id)


@dataclass(frozen=True)
class Completeness:
    """The ids of the runs that were `planned`, and of those that have no attempt of status ``ok``."""

    planned: tuple[str, ...]
    missing: tuple[str, ...]
    rejected: int
    """How many of the missing were driven and rejected or aborted."""

    @classmethod
    def of(cls, campaign: Campaign) -> Completeness | None:
        """Return it for `campaign`, None without a table ``planned``; raise `CampaignError` if that cannot be read."""
        if not campaign.has_table(PLANNED_TABLE):
            return None
        planned = tuple(campaign.table(PLANNED_TABLE)["run_id"].astype(str))
        tried = set(map(planned_id, campaign.run_ids))
        counted = set(map(planned_id, campaign.runs.loc[campaign.runs["status"] == RUN_OK, "run_id"]))
        missing = tuple(run_id for run_id in planned if run_id not in counted)
        return cls(planned, missing, len(tried.intersection(missing)))

    @property
    def is_complete(self) -> bool:
        """Whether every planned run has an attempt that counts."""
        return not self.missing

    def __str__(self) -> str:
        """Say it in a sentence without a subject."""
        driven = len(self.planned) - len(self.missing)
        rejected = f" ({self.rejected} of them rejected)" if self.rejected else ""
        named = ", ".join(self.missing[:_SHOWN]) + (", …" if len(self.missing) > _SHOWN else "")
        return f"{len(self.planned)} runs planned, {driven} driven, {len(self.missing)} missing{rejected}: {named}"
