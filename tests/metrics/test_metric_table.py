"""Metrics of a campaign: values of a known motion, the file that keeps them, and a lab's own metrics."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from agvbench.campaign import Campaign
from agvbench.errors import CampaignError, FileError
from agvbench.metrics import MeasuredRun, all_metrics, metric, metric_table
from agvbench.metrics.table import by_run, read_metrics, write_metrics
from agvbench.types import Commands, Frames, Pose, Run, TimeSeries

_RATE_HZ = 100.0
_TARGET, _START = Pose(2.0, 0.0, 0.0), Pose(0.3, -0.2, 0.7)


def _run(driven, *, target=_TARGET, logged=None):
    """Return a run that stands for 1 s, drives `driven` (n, 3) at 100 Hz, and stands for 1 s."""
    still = int(_RATE_HZ)
    poses = np.vstack([np.repeat(driven[:1], still, axis=0), driven, np.repeat(driven[-1:], still, axis=0)])
    on_floor = np.array([_START.compose(Pose(*pose)) for pose in poses])
    t_s = (np.arange(len(poses)) - still) / _RATE_HZ
    n = len(t_s)
    frames = Frames(t_s, *on_floor.T, np.ones(n, bool), np.arange(n), np.full(n, np.nan), np.full(n, np.nan))
    stop_s = len(driven) / _RATE_HZ
    commands = Commands(np.array([0.0, stop_s]), np.array([1.0, 0.0]), np.zeros(2), np.zeros(2))
    names = {"run_id": "one", "experiment": "trajectory", "trajectory": "line", "condition": "calibrated"}
    run = Run(
        **names, repeat=0, target=target, started_s=0.0, status="ok", firmware="", commands=commands, frames=frames
    )
    return replace(run, logged=logged(t_s) if logged else {})


def _line(*, across_m=0.0, n=400):
    x = np.linspace(0.0, 2.0, n)
    return np.column_stack([x, across_m * np.sin(np.pi * x / 2.0), np.zeros(n)])


def _planned(n=400):
    x = np.linspace(0.0, 2.0, n)
    return np.column_stack([np.arange(n) / _RATE_HZ, x, np.zeros(n), np.zeros(n)])


def _value(name, run):
    return all_metrics()[name].of(run)


def test_an_arch_beside_a_straight_has_its_height_and_its_root_mean_square():
    run = MeasuredRun.of(_run(_line(across_m=0.1)), _planned())
    assert _value("cross_track_max", run) == pytest.approx(100.0, abs=0.1)
    assert _value("cross_track_rms", run) == pytest.approx(100.0 / math.sqrt(2.0), rel=0.01)
    assert _value("cross_track_p95", run) == pytest.approx(100.0 * math.sin(0.475 * math.pi), rel=0.01)
    assert _value("position_error", run) == pytest.approx(0.0, abs=1e-6)
    assert _value("driving_time", run) == pytest.approx(4.0, abs=0.1)


def test_a_delay_is_an_absolute_trajectory_error_and_no_cross_track_error():
    delayed = np.vstack([np.zeros((20, 3)), _line()])
    run = MeasuredRun.of(_run(delayed), _planned())
    assert _value("cross_track_rms", run) == pytest.approx(0.0, abs=1e-6)
    assert _value("absolute_trajectory_error", run) == pytest.approx(100.0, rel=0.03)  # 0.2 s behind at 0.5 m/s
    assert _value("relative_trajectory_error", run) > 0.0


def test_what_drives_as_planned_has_no_trajectory_error():
    run = MeasuredRun.of(_run(_line()), _planned())
    for name in ("absolute_trajectory_error", "relative_trajectory_error"):
        assert _value(name, run) < 6.0  # one frame of 10 ms at 0.5 m/s


def test_energy_is_the_integral_of_logged_power():
    def logged(t_s):
        return {"battery_V": TimeSeries(t_s, np.full(len(t_s), 7.0)), "battery_A": TimeSeries(t_s, t_s * 0.0 + 2.0)}

    run = MeasuredRun.of(_run(_line(), logged=logged), None)
    assert _value("energy", run) == pytest.approx(14.0 * 4.99, rel=1e-3)
    assert math.isnan(_value("energy", MeasuredRun.of(_run(_line()), None)))


def test_without_a_plan_there_are_no_errors_along_the_path():
    run = MeasuredRun.of(_run(_line()), None)
    assert math.isnan(_value("cross_track_rms", run))
    assert math.isnan(_value("absolute_trajectory_error", run))
    assert math.isnan(_value("position_error", MeasuredRun.of(_run(_line(), target=Pose(*[math.nan] * 3)), None)))


def test_a_metric_that_fails_is_one_line_with_file_and_run():
    @metric(unit="V")
    def lowest_voltage(run):
        return min(run.logged["battery"].value)

    with pytest.raises(FileError, match=r"test_metric_table.py:\d+: metric lowest_voltage, run one: .*'battery'"):
        lowest_voltage.of(MeasuredRun.of(_run(_line()), None))


@pytest.mark.parametrize(
    "options", [{"unit": "far too long a unit"}, {"unit": "mm", "margin": -1.0}, {"unit": "mm", "digits": 20}]
)
def test_a_declaration_that_cannot_be_used_is_refused(options):
    with pytest.raises(FileError, match=r"test_metric_table\.py"):
        metric(**options)(lambda run: 0.0)


_OWN = '''
"""Own metrics."""
import numpy as np
from agvbench.metrics import metric

@metric(unit="mm", title="farthest to the left", margin=2.0)
def farthest_left(run):
    """Largest y in the start frame."""
    return 1e3 * np.max(run.driven[:, 2])
'''


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """Return a lab folder with an own metric, and a campaign of trajectories 1 and 5 in it."""
    lab = tmp_path_factory.mktemp("lab")
    (lab / "metrics").mkdir()
    (lab / "metrics" / "own.py").write_text(_OWN, encoding="utf-8")
    only = ["-k", "trajectory and (1-un or 5-un)", "--repeats", "2", "--seed", "4", "--out", "camp"]
    done = _agvbench(lab, "bench", *only)
    assert done.returncode == 0, done.stdout + done.stderr
    return lab


def _agvbench(folder, *arguments):
    command = [sys.executable, "-m", "agvbench", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_a_bench_writes_own_metrics_and_those_that_ship(lab):
    table = read_metrics(lab / "camp")
    assert {"position_error", "cross_track_rms", "farthest_left", "driving_time"} <= set(table["metric"])
    assert set(table[table["metric"] == "farthest_left"]["unit"]) == {"mm"}
    wide = by_run(table)
    assert len(wide) == table["run_id"].nunique()
    left = wide[wide["trajectory"] == "5"]["farthest_left"]
    assert (left > 500.0).all()
    report = (lab / "camp" / "report" / "report.html").read_text(encoding="utf-8")
    assert "farthest to the left" in report
    assert "cross-track error, RMS" in report


def test_a_mistake_in_one_metric_costs_no_other(tmp_path):
    (tmp_path / "metrics").mkdir()
    mistaken = _OWN.replace("run.driven[:, 2]", "run.logged['battery']")
    (tmp_path / "metrics" / "own.py").write_text(mistaken + _OWN.replace("farthest_left", "second"), encoding="utf-8")
    only = ["-k", "trajectory and 1-un", "--repeats", "1", "--out", "camp"]
    said = "metrics/own.py:9: metric farthest_left, run trajectory-1-uncalibrated-r01: cannot be evaluated: "
    driven = _agvbench(tmp_path, "bench", *only)
    assert driven.returncode == 2, driven.stdout
    assert f"metric farthest_left is left out: {said}" in " ".join(driven.stdout.split())
    reported = _agvbench(tmp_path, "report", "camp", "--no-recording")
    assert (reported.returncode, said in reported.stderr) == (2, True)
    metrics = set(read_metrics(tmp_path / "camp")["metric"])
    assert {"position_error", "second"} <= metrics
    assert "farthest_left" not in metrics
    page = (tmp_path / "camp" / "report" / "report.html").read_text(encoding="utf-8")
    assert "The metric farthest_left is left out: " in page


def test_a_metric_that_cannot_be_imported_is_said_before_anything_is_driven(tmp_path):
    (tmp_path / "metrics").mkdir()
    (tmp_path / "metrics" / "own.py").write_text(_OWN + "def half(:\n", encoding="utf-8")
    driven = _agvbench(tmp_path, "bench", "--out", "camp")
    assert driven.returncode == 2
    assert "metrics/own.py:10: cannot be imported" in driven.stdout + driven.stderr
    assert not (tmp_path / "camp").exists()


def test_the_file_is_listed_and_damage_is_found(lab, tmp_path):
    campaign = Campaign.open(lab / "camp").check()
    assert "errors.parquet" in (campaign.path / "SHA256SUMS").read_text(encoding="utf-8")
    before = (campaign.path / "SHA256SUMS").read_bytes()
    write_metrics(campaign.path, metric_table(campaign).loc[lambda t: t["metric"] != "none"])
    again = read_metrics(campaign.path)
    assert set(again["metric"]) >= {"position_error"}
    assert before in (campaign.path / "SHA256SUMS").read_bytes()
    file = campaign.path / "errors.parquet"
    kept = file.read_bytes()
    file.write_bytes(kept[:-20])
    try:
        with pytest.raises(CampaignError, match=r"errors\.parquet"):
            read_metrics(campaign.path)
    finally:
        file.write_bytes(kept)


def test_position_errors_are_those_of_pose_errors(lab):
    import agvbench

    errors = agvbench.pose_errors(lab / "camp").set_index("run_id")
    wide = by_run(metric_table(lab / "camp")).set_index("run_id")
    ok = wide.index[wide["status"] == "ok"]
    pd.testing.assert_series_equal(
        wide.loc[ok, "position_error"], errors.loc[ok, "position_mm"], check_names=False, check_index_type=False
    )


def test_a_campaign_of_other_programs_gets_no_list_of_hashes(tmp_path):
    table = pd.DataFrame({"run_id": ["a"], "metric": ["m"], "value": [1.0], "unit": ["mm"]})
    write_metrics(tmp_path, table)
    assert [file.name for file in tmp_path.iterdir()] == ["errors.parquet"]
    with pytest.raises(CampaignError, match="no column experiment"):
        read_metrics(tmp_path)


def test_an_own_metric_with_a_taken_name_is_refused(tmp_path):
    (tmp_path / "metrics").mkdir()
    taken = _OWN.replace("farthest_left", "position_error")
    (tmp_path / "metrics" / "own.py").write_text(taken, encoding="utf-8")
    program = "from agvbench.metrics import all_metrics; all_metrics()"
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "metrics/own.py: there is a metric of this name: position_error; rename it" in done.stderr
