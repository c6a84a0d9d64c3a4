"""Campaigns that were saved in every schema so far are read for ever."""

from __future__ import annotations

from pathlib import Path

import pytest
from campaign_samples import assert_same_run
from make_schema_data import HEADS, saved_runs

from agvbench.campaign import Campaign

DATA = Path(__file__).parent / "data"


@pytest.mark.parametrize("form", ["parts", "parquet", "csv"])
@pytest.mark.parametrize("schema", sorted(HEADS))
def test_saved_campaigns_read_as_they_were_written(schema: str, form: str) -> None:
    campaign = Campaign.open(DATA / schema / form).check()
    for expected, run in zip(saved_runs(schema), campaign, strict=True):
        assert_same_run(expected, run)
    assert campaign.header == HEADS[schema]


def test_a_saved_further_table_reads() -> None:
    assert Campaign.open(DATA / "schema_1/parts").table("events")["what"].tolist() == ["vehicle gone"]
