"""Parquet in and out: deterministic bytes, and damage reported in one line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from agvbench.errors import CampaignError
from agvbench.text_files import require_regular

MAX_ROWS = 100_000_000
MAX_BYTES = 4 << 30
"""What a table may take in memory; at 120 Hz its rows would last for more than five days."""
_SMALL_BYTES = 256 << 20
"""Below this bound on its memory a table is read at once, in half of the time that its texts' lengths first take."""
_BOUNDED_CODECS, _BOUNDED_RATIO = frozenset({"UNCOMPRESSED", "LZ4", "SNAPPY"}), 256
"""Formats in which no byte stands for more than 255 others."""
_TOO_LARGE = "is too large for memory"
_MAGIC = b"PAR1"


def to_parquet(table: pa.Table) -> memoryview:
    """Return `table` as parquet: floats split by byte (neighbouring poses share their high bytes), then LZ4.

    A part has a thousand rows: setting up zstd for each of its columns would take three times as long as LZ4 does,
    to save 4 % of space (docs/decisions/0008-campaign-files.md). The bytes depend on the table alone: no time stamps,
    no statistics, no pandas metadata.
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


def read_parquet(
    path: Path,
    *,
    max_rows: int = MAX_ROWS,
    max_bytes: int = MAX_BYTES,
    columns: Sequence[str] | None = None,
    plain: bool = True,
) -> pa.Table:
    """Read a parquet file, or those of the `columns` that it has; texts are dictionary columns unless `plain`.

    Raises
    ------
    CampaignError
        If it is not parquet, cut off, damaged, has more than `max_rows` rows, or would take more than `max_bytes` of
        memory: a small file can hold a value that is repeated for ever.
    FileError
        If it is no regular file.
    """
    try:
        require_regular(path)
        with pa.OSFile(str(path)) as source:
            file = pq.ParquetFile(source, page_checksum_verification=True)
            _require_room(path, "has too many rows", file.metadata.num_rows, max_rows, "")
            _require_room(path, _TOO_LARGE, _least_bytes(file), max_bytes, " bytes")
            names = None if columns is None else list(columns)
            if plain and _most_bytes(file, source.size()) <= min(max_bytes, _SMALL_BYTES):
                table = file.read(columns=names, use_threads=False)
                table.validate(full=True)
                return _plain(table)
            texts = [field.name for field in file.schema_arrow if pa.types.is_string(field.type)]
            file = pq.ParquetFile(
                source, metadata=file.metadata, read_dictionary=texts, page_checksum_verification=True
            )
            table = file.read(columns=names, use_threads=False)
            if not plain:  # each text is in memory once
                return table
            _require_room(path, _TOO_LARGE, sum(map(_text_bytes, table.columns)), max_bytes, " bytes")
            return _plain(table)
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        raise CampaignError(
            _what_is_wrong(path, error),
            where=path,
            remedy="restore the file from a copy, or delete the run and drive it again",
        ) from None


def _require_room(path: Path, what: str, value: int, limit: int, unit: str) -> None:
    if value > limit:
        raise CampaignError(
            what, where=path, value=f"{value}{unit}", limit=f"{limit}{unit}", remedy="split the campaign"
        )


def _least_bytes(file: pq.ParquetFile) -> int:
    """Return the memory that all values take: eight bytes each, or as many as are stored; repeated texts take more."""
    metadata, kinds = file.metadata, file.schema_arrow.types
    groups = [metadata.row_group(index) for index in range(metadata.num_row_groups)]
    values = metadata.num_rows * len(kinds)
    if any(map(pa.types.is_nested, kinds)):
        values = sum(group.column(index).num_values for group in groups for index in range(metadata.num_columns))
    stored = sum(int(group.total_byte_size) for group in groups)
    return max(8 * int(values), stored)


def _most_bytes(file: pq.ParquetFile, size: int) -> float:
    """Return the memory that a file of `size` bytes takes at most: as if each row had all that the file can hold.

    What it says of its own sizes does not count here.
    """
    metadata = file.metadata
    groups = [metadata.row_group(index) for index in range(metadata.num_row_groups)]
    codecs = {group.column(index).compression for group in groups for index in range(metadata.num_columns)}
    if not codecs <= _BOUNDED_CODECS or any(map(pa.types.is_nested, file.schema_arrow.types)):
        return math.inf
    return float(metadata.num_rows) * _BOUNDED_RATIO * size


def _text_bytes(column: pa.ChunkedArray) -> int:
    """Return the bytes of a column of texts once each row has its own; 0 for other columns."""
    if not isinstance(column.type, pa.DictionaryType) or not pa.types.is_string(column.type.value_type):
        return 0
    lengths = (pc.sum(pc.binary_length(chunk.dictionary).take(chunk.indices)).as_py() for chunk in column.chunks)
    return sum(length or 0 for length in lengths)


def _plain(table: pa.Table) -> pa.Table:
    """Decode dictionary columns, such as texts and pandas categoricals, so that equal columns have equal types.

    Raise `ArrowInvalid` if a text is not UTF-8.
    """
    for index, kind in enumerate(table.schema.types):
        if isinstance(kind, pa.DictionaryType):
            for chunk in table.column(index).chunks:
                chunk.dictionary.validate(full=True)
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
