"""The residuals that are drawn, against a prediction that is wrong in a known way."""

from __future__ import annotations

import numpy as np
from tiny_vehicle import Tiny, campaign_runs

from agvbench.diagnosis.data.readings import read_runs
from agvbench.diagnosis.findings.residual_table import residual_table


def test_a_prediction_that_is_short_by_five_per_cent_misses_five_per_cent():
    quiet = Tiny(noise_m=1e-5, noise_rad=1e-5)
    readings = read_runs(campaign_runs(quiet, steps=False)[:12])
    start = readings.start[:, None]
    short = readings.poses.copy()
    short[..., :2] = start[..., :2] + (readings.poses[..., :2] - start[..., :2]) / 1.05
    held = np.arange(len(readings)) % 4 == 0
    table = residual_table(readings, held, short, readings.poses)
    np.testing.assert_allclose(table["before_speed"], 0.05, atol=0.02)
    np.testing.assert_allclose(table["after_speed"], 0.0, atol=1e-9)
    assert set(table["run_id"]) == {run.run_id for run in readings.runs}
    assert set(table.loc[table["held_out"], "run_id"]) == {readings.runs[i].run_id for i in np.flatnonzero(held)}
    assert table.groupby("run_id").size().min() > 5
    assert np.isfinite(table.drop(columns=["run_id"]).to_numpy(dtype=float)).all()
