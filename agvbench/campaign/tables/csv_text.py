"""CSV in, every cell as text: the wrong delimiter or encoding is reported in one line."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import pyarrow as pa
import pyarrow.csv as pa_csv

from agvbench.errors import FileError
from agvbench.text_files import require_regular

MAX_BYTES = 4 << 30
_DELIMITERS = {";": "semicolons", "\t": "tabs", "|": "bars"}


def read_csv_text(
    path: Path,
    *,
    columns: Collection[str] | None = None,
    delimiter: str = ",",
    decimal: str = ".",
    encoding: str = "utf-8",
    skip_rows: int = 0,
) -> pa.Table:
    """Read a CSV with a header line; an empty cell of text is empty text.

    Parameters
    ----------
    path
        The file.
    columns
        The columns that stay text, for the caller to convert and to say which cell cannot be; by default all. The
        others get the type that all their cells have.
    delimiter, decimal, encoding, skip_rows
        How it is written, and how many lines come before the header.

    Raises
    ------
    FileError
        If the file is missing, no regular file, too large, in another encoding or delimiter, ragged, or has no header.
    """
    names = _header(path, delimiter, encoding, skip_rows)
    try:
        text = dict.fromkeys(names if columns is None else columns, pa.string())
        return pa_csv.read_csv(
            path,
            # The names come from here, not from the file, where spaces may surround them.
            read_options=pa_csv.ReadOptions(
                encoding=encoding, column_names=names, skip_rows=skip_rows + 1, use_threads=False
            ),
            parse_options=pa_csv.ParseOptions(delimiter=delimiter),
            convert_options=pa_csv.ConvertOptions(column_types=text, strings_can_be_null=False, decimal_point=decimal),
        )
    except (pa.ArrowException, UnicodeDecodeError) as error:
        reason = str(error).splitlines()[0].removeprefix("CSV parse error: ")[:120]
        raise FileError(f"is not CSV ({reason})", where=path, remedy="correct the line") from None


def _header(path: Path, delimiter: str, encoding: str, skip_rows: int) -> list[str]:
    import csv

    try:
        require_regular(path)
        if path.stat().st_size > MAX_BYTES:
            raise FileError(
                "is too large", where=path, value=f"{path.stat().st_size} bytes", limit=f"{MAX_BYTES} bytes"
            )
        with path.open(encoding=encoding.replace("utf-8", "utf-8-sig"), newline="") as stream:
            for _ in range(skip_rows):
                stream.readline()
            line = stream.readline(1 << 20)
    except OSError as error:
        raise FileError(f"cannot be read ({error.strerror})", where=path, remedy="check the path") from None
    except UnicodeError:
        raise FileError(f"is not {encoding} text", where=path, remedy=f"save it as {encoding.upper()}") from None
    except (LookupError, ValueError):  # ValueError: a name with a NUL
        raise FileError(
            "encoding is unknown", where=path, value=repr(encoding), remedy="give utf-8 or latin-1"
        ) from None
    if not line.strip() or "\0" in line:
        raise FileError("has no header line", where=path, remedy="give a CSV whose first line names its columns")
    if not line.endswith(("\n", "\r")):
        raise FileError("has a header and nothing else", where=path, remedy="give a CSV with rows")
    for other, plural in _DELIMITERS.items():
        if delimiter not in line and other != delimiter and other in line:
            raise FileError(
                f"is separated by {plural}", where=path, limit=repr(delimiter), remedy=f"save it with {delimiter!r}"
            )
    names = [name.strip() for name in next(csv.reader([line], delimiter=delimiter))]
    for name in names:
        if names.count(name) > 1:
            raise FileError("two columns have one name", where=path, value=name[:80] or "(empty)", remedy="rename one")
    return names
