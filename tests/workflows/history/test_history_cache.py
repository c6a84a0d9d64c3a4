"""Campaigns that were read before: they are not read again, and nothing else changes."""

from __future__ import annotations

import os

import pandas as pd
import pytest
from history_samples import write_night, write_nights

from agvbench.metrics.table import FILE, read_metrics, write_metrics
from agvbench.workflows.history.reading import history


@pytest.fixture
def nights(tmp_path, monkeypatch):
    monkeypatch.setenv("AGVBENCH_CACHE", str(tmp_path / "cache"))
    write_nights(tmp_path / "nights", 12, step_mm=8.0, at=6)
    return tmp_path / "nights"


def _tables(folder):
    found = history(folder)
    return [found.campaigns, found.nights, found.series, found.changes]


def _assert_equal(one, other):
    for before, after in zip(one, other, strict=True):
        # Texts are categories, whose order is that in which campaigns were read.
        pd.testing.assert_frame_equal(before.astype(object), after.astype(object))


def test_a_campaign_whose_files_have_not_changed_is_not_read_again(nights):
    before = _tables(nights)
    for file in nights.glob(f"*/{FILE}"):
        status = file.stat()
        file.write_bytes(b"x" * status.st_size)
        os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns))
    _assert_equal(before, _tables(nights))


def test_a_campaign_that_is_gone_is_kept_no_more(nights):
    first = _tables(nights)[1]
    name = first["campaign"].iloc[0]
    for file in (nights / name).iterdir():
        file.unlink()
    (nights / name).rmdir()
    assert len(history(nights).campaigns) == 11
    again = _tables(nights)[1]
    assert name not in set(again["campaign"])


def test_a_campaign_that_changed_is_read_again(nights):
    history(nights)
    table = read_metrics(nights / "night-00")
    write_metrics(nights / "night-00", table.assign(value=1000.0))
    again = history(nights).nights
    assert again.loc[again["campaign"] == "night-00", "value"].to_numpy() == pytest.approx(1000.0)


def test_a_night_more_is_read_beside_those_that_were_kept(nights):
    history(nights)
    write_night(nights / "night-2030-01-01", {("position_error", "1"): [500.0] * 3})
    assert history(nights).campaigns["campaign"].iloc[-1] == "night-2030-01-01"


@pytest.mark.parametrize("content", [b"", b"PAR1 and nothing else"])
def test_a_damaged_cache_is_as_good_as_none(nights, tmp_path, content):
    before = _tables(nights)
    (file,) = (tmp_path / "cache" / "history").iterdir()
    file.write_bytes(content)
    _assert_equal(before, _tables(nights))
    assert file.stat().st_size > len(content)


def test_a_cache_that_cannot_be_written_costs_nothing_but_time(nights, tmp_path):
    (tmp_path / "cache").write_text("no directory")
    assert len(history(nights).campaigns) == 12


def test_what_was_not_asked_for_in_a_long_time_is_deleted(nights, tmp_path):
    (tmp_path / "cache" / "history").mkdir(parents=True)
    old = tmp_path / "cache" / "history" / "old.parquet"
    old.write_bytes(b"")
    os.utime(old, (1e9, 1e9))
    history(nights)
    assert not old.exists()
