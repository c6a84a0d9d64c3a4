"""Tables that are too large are refused before they are read."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pytest

from agvbench.campaign.csv_text import MAX_BYTES, read_csv_text
from agvbench.campaign.parquet import read_parquet, to_parquet
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
