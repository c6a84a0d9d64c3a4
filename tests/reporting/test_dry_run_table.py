"""The table of a dry run: its columns add up, and so do its rows."""

from __future__ import annotations

import pytest

from agvbench.model import example_vehicle
from agvbench.planning import load_trajectory, plan
from agvbench.reporting.console.bench import dry_run_table
from agvbench.running.execution.run_records import RunRequest
from agvbench.types import Pose


def planned(name):
    made = plan(load_trajectory(name), example_vehicle("thesis"))
    start = Pose(0.0, 0.0, 0.0)
    return RunRequest(name, "trajectory", name, "calibrated", 1, made.commands, made.target, start), made


def minutes(line):
    """Return the cells of minutes: driving, between runs, in all."""
    return [float(cell) for cell in line.split()[-6:-3]]


def test_rows_and_columns_of_times_add_up():
    drives = [planned(name) for name in "1358" * 8]
    lines = dry_run_table(drives).splitlines()
    rows = [minutes(line) for line in lines if line.split()[:1] == ["trajectory"]]
    (total,) = [minutes(line) for line in lines if line.startswith(" total")]
    assert len(rows) == 4
    for driving, between, both in (*rows, total):
        assert both == pytest.approx(driving + between, abs=0.11)
    assert total == pytest.approx([sum(column) for column in zip(*rows, strict=True)], abs=0.21)
    assert total[0] == pytest.approx(sum(plan.duration_s for _, plan in drives) / 60.0, abs=0.051)
    assert total[1] == pytest.approx(32 * 17.0 / 60.0, abs=0.051)
    assert "17 s between two runs" in " ".join(lines)


@pytest.mark.parametrize("columns", ["", "80", "100"])
def test_it_is_as_wide_as_columns_says_and_cuts_nothing(columns, monkeypatch):
    if columns:
        monkeypatch.setenv("COLUMNS", columns)
    lines = dry_run_table([planned("4")]).splitlines()
    assert max(map(len, lines)) <= int(columns or 100)
    assert "…" not in "".join(lines)


def test_nothing_is_a_table_too():
    assert dry_run_table([]).rstrip().endswith("nothing")
