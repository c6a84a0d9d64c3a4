"""Tables that are too large are refused before they are read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from campaign_samples import HEADER, make_run

from agvbench.campaign import Campaign, CampaignWriter
from agvbench.campaign.tables.csv_text import MAX_BYTES, read_csv_text
from agvbench.campaign.tables.parquet import read_parquet, to_parquet
from agvbench.errors import CampaignError, FileError


def test_a_csv_that_is_too_large(tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    with path.open("wb") as file:
        file.truncate(MAX_BYTES + 1)  # takes no room on the disk
    with pytest.raises(FileError, match=f"poses.csv: is too large: {MAX_BYTES + 1} bytes"):
        read_csv_text(path)


def test_a_header_without_end(tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    path.write_bytes(b"a," * (1 << 20))
    with pytest.raises(FileError, match="has a header and nothing else"):
        read_csv_text(path)


def test_a_parquet_with_too_many_rows(tmp_path: Path) -> None:
    path = tmp_path / "poses.parquet"
    path.write_bytes(to_parquet(pa.table({"t_s": [0.0, 1.0, 2.0]})))
    with pytest.raises(CampaignError, match=r"poses.parquet: has too many rows: 3 \(limit: 2\)"):
        read_parquet(path, max_rows=2)
    assert read_parquet(path, max_rows=3).num_rows == 3


@pytest.mark.parametrize(
    "column",
    [
        pa.array(np.zeros(30_000)),
        pa.DictionaryArray.from_arrays(pa.array(np.zeros(300, np.int32)), ["x" * 1000]),
        pa.array([[0.0] * 30_000]),
    ],
    ids=["numbers", "texts", "lists"],
)
def test_a_small_parquet_file_that_grows_in_memory_is_refused(column: pa.Array, tmp_path: Path) -> None:
    path = tmp_path / "poses.parquet"
    pq.write_table(pa.table({"extra": column}), path, compression="zstd", store_schema=False)
    assert path.stat().st_size < 10_000
    with pytest.raises(CampaignError, match=r"is too large for memory: \d+ bytes \(limit: 100000 bytes\); split"):
        read_parquet(path, max_bytes=100_000)
    assert read_parquet(path, max_bytes=400_000).num_rows == len(column)


def test_parts_share_one_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    writer = CampaignWriter.create(tmp_path / "c", HEADER, durable=False)
    for name in "abc":
        writer.append(make_run(name, frames=1000))
    monkeypatch.setattr("agvbench.campaign.tables.source.MAX_BYTES", 150_000)
    with pytest.raises(CampaignError, match=r"poses.parquet/c.parquet: is too large for memory"):
        Campaign.open(writer.path).check()


@pytest.mark.parametrize("table", ["runs", "provenance"])
def test_text_that_is_not_utf_8_is_damage(table: str, tmp_path: Path) -> None:
    text = pa.array([b"\xff\xfe"], pa.binary()).view(pa.string())
    path = tmp_path / f"{table}.parquet"
    pq.write_table(pa.table({"run_id": ["a"], "value": text}), path)
    with pytest.raises(CampaignError, match=f"{table}.parquet: is damaged and cannot be decoded"):
        read_parquet(path)
