"""Parquet in and out: deterministic bytes, and damage told in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from agvbench.errors import CampaignError
from agvbench.text_files import require_regular

MAX_ROWS = 100_000_000
_MAGIC = b"PAR1"


def to_parquet(table: pa.Table) -> memoryview:
    """Return `table` as parquet: floats split by byte (neighbouring poses share their high bytes), then LZ4.

    A part has a thousand rows: setting up zstd for each of its columns would take three times as long as LZ4 does,
    to save 4 % of space (docs/decisions/campaign-recording.md). The bytes depend on the table alone: no time stamps, no
    statistics, no pandas metadata.
    """
    encodings: dict[str, str] = {}
    dictionaries: list[str] = []
    for field in table.schema:
        if pa.types.is_floating(field.type):
            encodings[field.name] = "BYTE_STREAM_SPLIT"
        elif pa.types.is_integer(field.type):
            encodings[field.name] = "DELTA_BINARY_PACKED"
        else:
            dictionaries.append(field.name)
    sink = pa.BufferOutputStream()
    pq.write_table(
        table,
        sink,
        compression="lz4",
        use_dictionary=dictionaries,
        column_encoding=encodings,
        write_statistics=False,
        store_schema=False,
        write_page_checksum=True,
    )
    return memoryview(sink.getvalue())


def read_parquet(path: Path, *, max_rows: int = MAX_ROWS) -> pa.Table:
    """Read a parquet file.

    Raises
    ------
    CampaignError
        If it is not parquet, cut off, damaged or has more than `max_rows` rows.
    FileError
        If it is no regular file.
    """
    try:
        require_regular(path)
        with pa.OSFile(str(path)) as source:
            file = pq.ParquetFile(source, page_checksum_verification=True)
            if file.metadata.num_rows > max_rows:
                raise CampaignError(
                    "has too many rows",
                    where=path,
                    value=file.metadata.num_rows,
                    limit=f"{max_rows}",
                    remedy="split the campaign",
                )
            return _plain(file.read(use_threads=False))
    except (pa.ArrowException, OSError) as error:
        raise CampaignError(
            _what_is_wrong(path, error),
            where=path,
            remedy="restore the file from a copy, or delete the run and drive it again",
        ) from None


def _plain(table: pa.Table) -> pa.Table:
    """Decode dictionary columns, which pandas categoricals become, so that equal columns have equal types."""
    for index, kind in enumerate(table.schema.types):
        if isinstance(kind, pa.DictionaryType):
            table = table.set_column(index, table.column_names[index], table.column(index).cast(kind.value_type))
    return table


def _what_is_wrong(path: Path, error: Any) -> str:
    try:
        with path.open("rb") as stream:
            head = stream.read(4)
            stream.seek(-min(4, path.stat().st_size), 2)
            tail = stream.read(4)
    except OSError as problem:
        return f"cannot be read ({problem.strerror})"
    if head != _MAGIC:
        return "is not a parquet file"
    if tail != _MAGIC:
        return "is cut off: the parquet footer is missing"
    return "is damaged and cannot be decoded"
