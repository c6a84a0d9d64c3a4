"""Where a diagnosis comes from: the part of its provenance that runs from rest and windows share."""

from __future__ import annotations

from collections import Counter

from agvbench.calibration.campaign_protocol import HeaderLike
from agvbench.diagnosis.reading import Readings
from agvbench.errors import CampaignError


def provenance(header: HeaderLike, readings: Readings, seed: int, *, runs_used: int) -> dict[str, object]:
    """Return version, campaign, seed, how many runs were used, and how many were refused for which reason."""
    from agvbench import __version__

    return {
        "agvbench": __version__,
        "campaign": header.name,
        "seed": seed,
        "runs_used": runs_used,
        "runs_refused": dict(Counter(readings.refused.values())),
    }


def refuse_nothing(readings: Readings, header: HeaderLike) -> None:
    """Raise `CampaignError` if no run can be used, with what is wrong with the first."""
    if not len(readings):
        first = next(iter(readings.refused.items()), ("", "there are none"))
        raise CampaignError("no run can be used", where=f"campaign {header.name}", value=f"{first[0]}: {first[1]}")
