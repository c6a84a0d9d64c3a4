"""Campaigns that were saved in every schema so far are read for ever."""

from __future__ import annotations

from pathlib import Path

import pytest
from campaign_samples import assert_same_run
from make_schema_data import saved_runs

from agvbench.campaign import Campaign
from agvbench.vehicle.channels import Channels

DATA = Path(__file__).parent / "data"


@pytest.mark.parametrize("saved", ["schema_1/parts", "schema_1/parquet", "schema_1/csv"])
def test_saved_campaigns_read_as_they_were_written(saved: str) -> None:
    campaign = Campaign.open(DATA / saved).check()
    for expected, run in zip(saved_runs(), campaign, strict=True):
        assert_same_run(expected, run)
    header = campaign.header
    assert (header.schema, header.name, header.vehicle_name) == (1, "saved", "thesis")
    assert (header.front_axle_m, header.rear_axle_m, header.channels) == (0.11, 0.09, Channels.alike("us"))
    assert (header.mocap_rate_hz, header.prediction_horizon_s, header.prediction_stride_s) == (120.0, 1.0, 0.5)


def test_a_saved_further_table_reads() -> None:
    assert Campaign.open(DATA / "schema_1/parts").table("events")["what"].tolist() == ["vehicle gone"]
