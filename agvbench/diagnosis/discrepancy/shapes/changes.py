"""Shapes of changes with campaign time and with logged columns."""

from __future__ import annotations

from collections.abc import Iterator

from agvbench.diagnosis import terms
from agvbench.diagnosis.discrepancy.campaign_time import changes, columns_by_campaign_time
from agvbench.diagnosis.discrepancy.regression import Columns
from agvbench.diagnosis.discrepancy.shapes.base import Evidence, Option, Shapes, Values
from agvbench.diagnosis.terms import DiscrepancyTerm
from agvbench.types import Floats

_BY_LOGGED_COLUMN: dict[type[DiscrepancyTerm], type[terms.ByLoggedColumn]] = {
    terms.SpeedByCampaignTime: terms.SpeedByLoggedColumn,
    terms.SteeringByCampaignTime: terms.SteeringByLoggedColumn,
    terms.TrimByCampaignTime: terms.TrimByLoggedColumn,
}


def changes_with_time(of: Evidence) -> Shapes:
    """Yield the terms of campaign time, each with the course that gains most, and those of logged columns."""
    for term, columns, change in changes(of.rates, of.history, of.geometry, of.regression):
        yield term, iter([(columns, change.values)])
    yield from _logged(of)


def _logged(of: Evidence) -> Shapes:
    """Yield the terms of logged columns: the regressors of a change with time, in proportion to each column."""
    if not of.rates.standardised.shape[1]:
        return
    for of_time, columns in columns_by_campaign_time(of.rates, of.history, of.geometry):
        if of_time in _BY_LOGGED_COLUMN:
            yield _BY_LOGGED_COLUMN[of_time], _in_proportion(columns, of.rates.standardised)


def _in_proportion(columns: Columns, standardised: Floats) -> Iterator[Option]:
    for number, z in enumerate(standardised.T):
        yield {k: z[:, None] * column for k, column in columns.items()}, Values(float(number))
