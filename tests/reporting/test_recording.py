"""The recording of a campaign with many runs is written by a process of its own, beside what the report computes."""

from __future__ import annotations

from pathlib import Path

from report_samples import make_campaign

from agvbench.campaign import Campaign
from agvbench.executors import Executor
from agvbench.metrics.planned_paths import PlannedPaths
from agvbench.reporting import recording
from agvbench.reporting.viewer.recording_file import Recorded


def test_what_is_computed_of_runs_does_not_reach_what_is_being_sent(tmp_path, monkeypatch):
    campaign = Campaign.open(make_campaign(tmp_path / "c", repeats=1, calibration=False))
    runs = list(map(PlannedPaths(campaign).measured, campaign))
    sent: list[Recorded] = []

    def keep(_: Executor, shown: Recorded, path: Path) -> None:
        sent.append(shown)
        path.write_bytes(b"")

    monkeypatch.setattr(recording, "_OWN_PROCESS_RUNS", 1)
    monkeypatch.setattr(recording, "_write", keep)
    counted = [run for run in runs if run.is_ok]
    with recording.recorder(campaign, tmp_path / "recording.rrd") as record:
        record(runs)
        for run in counted:
            _ = run.driven, run.error
    assert all({"driven", "error"} <= vars(run).keys() for run in counted)
    assert [run.run_id for run in sent[0].runs] == [run.run_id for run in counted]
    assert not any({"driven", "error"} & vars(run).keys() for run in sent[0].runs)
