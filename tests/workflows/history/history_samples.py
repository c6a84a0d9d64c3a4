"""Campaigns of many nights, whose metrics are numbers with a known truth."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np
import pandas as pd

from agvbench.campaign import CampaignHeader
from agvbench.campaign.header import FILE_NAME
from agvbench.campaign.manifest import record
from agvbench.campaign.tables.parquet import to_parquet
from agvbench.metrics.table import COLUMNS, write_metrics
from agvbench.vehicle.channels import Channels

METRICS = {"position_error": "mm", "heading_error": "deg", "own_metric": "V"}
BEGAN = datetime(2026, 3, 1, 21, 30, tzinfo=UTC)


def write_night(path, values, *, firmware="2.0", began=None, header=None, agvbench="0.2.0"):
    """Write a campaign whose table of metrics has ``values[metric, trajectory]``, a list with a number per repeat."""
    path.mkdir(parents=True)
    header = header or CampaignHeader(1, path.name, "mule", 0.11, 0.09, Channels.alike("us"), 120.0)
    header.save(path / FILE_NAME)
    if began is not None:
        import pyarrow as pa

        facts = pa.table({"name": ["began", "agvbench"], "value": [began.isoformat(), agvbench]})
        record(path, {"provenance.parquet": to_parquet(facts)})
    rows = [
        (f"{trajectory}-{repeat}", "trajectory", trajectory, "calibrated", repeat, "", firmware, 20.0 * repeat, "ok",
         metric, value, METRICS[metric])
        for (metric, trajectory), repeats in values.items()
        for repeat, value in enumerate(repeats)
    ]  # fmt: skip
    write_metrics(path, pd.DataFrame(rows, columns=list(COLUMNS)))
    return path


def write_nights(folder, count, *, step_mm=0.0, at=0, seed=0):
    """Write nights of two trajectories and three metrics; the end position error steps before night `at`."""
    rng = np.random.default_rng(seed)
    for night in range(count):
        changed = night >= at > 0
        level = {"position_error": 20.0 + step_mm * changed, "heading_error": 1.0, "own_metric": 7.0}
        shift = dict(zip(METRICS, rng.normal(size=3) * [1.0, 0.1, 0.2], strict=True))
        values = {
            (metric, trajectory): list(level[metric] + shift[metric] + 0.01 * rng.normal(size=3))
            for metric in METRICS
            for trajectory in ("1", "2")
        }
        path = folder / f"night-{night:02d}"
        write_night(path, values, firmware="2.1" if changed else "2.0", began=BEGAN + timedelta(days=night))
    return folder
