"""How a notebook shows a campaign."""

from __future__ import annotations

from typing import TYPE_CHECKING

from agvbench.notebook_html import heading_html, table_html
from agvbench.types import CONDITIONS, RUN_OK

if TYPE_CHECKING:
    import pandas as pd

    from agvbench.campaign.campaign import Campaign


def campaign_html(campaign: Campaign) -> str:
    """Return its name and vehicle, and how many runs count by experiment, trajectory and condition."""
    header, runs = campaign.header, campaign.runs
    counts = int((runs["status"] == RUN_OK).sum())
    line = f"vehicle {header.vehicle_name}, {len(runs)} runs, {counts} of them count"
    conditions = _in_order(runs["condition"])
    columns = ["experiment", "trajectory", *conditions]
    return heading_html(header.name, line) + table_html("runs that count", columns, _rows(runs, conditions))


def _rows(runs: pd.DataFrame, conditions: list[str]) -> list[list[str | float | None]]:
    rows: list[list[str | float | None]] = []
    for (experiment, trajectory), group in runs.groupby(["experiment", "trajectory"]):
        own = group["condition"][group["status"] == RUN_OK]
        rows.append([str(experiment), str(trajectory), *(int((own == condition).sum()) for condition in conditions)])
    return rows


def _in_order(conditions: pd.Series) -> list[str]:
    found = [str(condition) for condition in conditions.unique()]
    return [c for c in CONDITIONS if c in found] + sorted(c for c in found if c not in CONDITIONS)
