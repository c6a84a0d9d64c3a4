"""Find and read one table of a campaign: a parquet file, a CSV, or a directory of per-run parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa

from agvbench.campaign.atomic_files import is_temporary
from agvbench.campaign.manifest import Manifest
from agvbench.campaign.tables.csv_text import read_csv_text
from agvbench.campaign.tables.parquet import MAX_BYTES, MAX_ROWS, read_parquet
from agvbench.campaign.tables.schema import ColumnSpec, fill_columns, type_columns
from agvbench.errors import CampaignError

SUFFIXES = (".parquet", ".csv")


@dataclass(frozen=True)
class Source:
    """Where a table lies: one file, or a directory with a part for each run."""

    path: Path
    files: tuple[Path, ...]
    in_parts: bool
    manifest: Manifest

    @classmethod
    def find(cls, directory: Path, name: str, manifest: Manifest) -> Source:
        """Find table `name` of the campaign in `directory`, whose files `manifest` lists.

        Raises
        ------
        CampaignError
            If it is absent, or present as parquet and as CSV.
        """
        paths = [path for suffix in SUFFIXES if (path := directory / f"{name}{suffix}").exists()]
        if not paths:
            raise CampaignError(
                f"has no table {name}",
                where=directory,
                remedy=f"add {name}.parquet (a file, or a directory of parts) or {name}.csv",
            )
        if len(paths) > 1:
            raise CampaignError(
                f"has table {name} twice, as {paths[0].name} and {paths[1].name}", where=directory, remedy="delete one"
            )
        path = paths[0]
        is_directory = path.is_dir()
        return cls(path, parts(path) if is_directory else (path,), is_directory, manifest)

    def read(self, columns: Sequence[ColumnSpec]) -> pa.Table:
        """Read all of it, with the types of `columns`.

        Raises
        ------
        CampaignError
            If a file has changed since it was recorded, cannot be read, lacks a column, or holds a value of the wrong
            type.
        """
        tables, room, room_bytes = [], MAX_ROWS, MAX_BYTES
        for file in self.files:
            self.manifest.check(file)
            tables.append(type_columns(_read_file(file, columns, room, room_bytes), columns, file))
            room, room_bytes = room - tables[-1].num_rows, room_bytes - tables[-1].nbytes
        if not tables:
            return type_columns(_nothing(columns), columns, self.path)
        try:
            whole = pa.concat_tables(tables, promote_options="permissive")
        except pa.ArrowException as error:
            reason = str(error).splitlines()[0][:120]
            raise CampaignError(
                f"parts disagree on a column's type ({reason})",
                where=self.path,
                remedy="rename the column in some parts",
            ) from None
        return fill_columns(whole, columns, self.path)


def parts(directory: Path) -> tuple[Path, ...]:
    """Return the whole parts in `directory`, by name; raise `CampaignError` if it cannot be listed."""
    try:
        files = [file for file in directory.iterdir() if file.suffix in SUFFIXES and not is_temporary(file)]
    except OSError as error:
        raise CampaignError(f"cannot be read ({error.strerror})", where=directory, remedy="check permissions") from None
    return tuple(sorted(files, key=lambda file: file.name))


def _read_file(file: Path, columns: Sequence[ColumnSpec], max_rows: int, max_bytes: int) -> pa.Table:
    if file.suffix == ".csv":
        return read_csv_text(file, columns=[column.name for column in columns])
    return read_parquet(file, max_rows=max_rows, max_bytes=max_bytes)


def _nothing(columns: Sequence[ColumnSpec]) -> pa.Table:
    return pa.table({column.name: pa.array([], pa.null()) for column in columns if column.required})
