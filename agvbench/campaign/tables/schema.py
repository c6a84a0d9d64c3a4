"""The columns of the tables, and their types: a cell that cannot have its type is named."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from agvbench.errors import CampaignError
from agvbench.types import Floats

Kind = Literal["text", "number", "count", "flag"]


class ColumnSpec(NamedTuple):
    """A known column: `number` is a float, `count` an integer, `flag` a truth value."""

    name: str
    kind: Kind
    required: bool = True


def _columns(kind: Kind, names: str, *, required: bool = True) -> tuple[ColumnSpec, ...]:
    return tuple(ColumnSpec(name, kind, required) for name in names.split())


RUNS = (
    *_columns("text", "run_id experiment trajectory condition"),
    *_columns("count", "repeat"),
    *_columns("number", "target_x_m target_y_m target_heading_rad started_s"),
    *_columns("text", "status firmware"),
    *_columns("text", "session split", required=False),
)
COMMANDS = (*_columns("text", "run_id"), *_columns("number", "t_s drive front rear"))
POSES = (
    *_columns("text", "run_id"),
    *_columns("number", "t_s x_m y_m heading_rad"),
    *_columns("flag", "tracked"),
    *_columns("count", "frame", required=False),
    *_columns("number", "mean_error_m received_s", required=False),
)
NAMES_OF_POSES = frozenset(column.name for column in POSES)
"""Further columns of the poses have other names."""
LONGEST_NAME = 60
TABLES: dict[str, tuple[ColumnSpec, ...]] = {"runs": RUNS, "commands": COMMANDS, "poses": POSES}
SPLITS = ("fit", "validation", "held_out")


def can_name_column(name: str) -> bool:
    """Return whether a further column can have this name: one that can be shown."""
    return bool(name.strip()) and name.isprintable() and len(name) <= LONGEST_NAME


_TYPES: dict[Kind, pa.DataType] = {"text": pa.string(), "number": pa.float64(), "count": pa.int64(), "flag": pa.bool_()}
_WORDS: dict[Kind, str] = {"text": "text", "number": "a number", "count": "a whole number", "flag": "true or false"}
_LONGEST_VALUE = 80
UNKNOWN_COUNT = -1


def type_columns(table: pa.Table, columns: Sequence[ColumnSpec], where: object) -> pa.Table:
    """Return `table` with its known columns as text, float64, int64 or bool; unknown columns stay as they are.

    Raises
    ------
    CampaignError
        If a required column is absent or a cell cannot have the column's type.
    """
    names = table.column_names
    for column in columns:
        if column.name in names:
            index = names.index(column.name)
            values = table.column(index)
            if values.type != _TYPES[column.kind]:
                table = table.set_column(index, column.name, _convert(values, column, where))
        elif column.required:
            raise _absent(column.name, names, where)
    return table


def fill_columns(table: pa.Table, columns: Sequence[ColumnSpec], where: object) -> pa.Table:
    """Return `table` without nulls in its known columns, but for optional text.

    A missing number is NaN, a missing text empty, a missing optional count −1, a missing flag false.

    Raises
    ------
    CampaignError
        If a run_id or a required count is missing.
    """
    names = table.column_names
    for column in columns:
        if column.name in names:
            index = names.index(column.name)
            if table.column(index).null_count:
                table = table.set_column(index, column.name, _fill(table.column(index), column, where))
    return table


def numbers(values: pa.ChunkedArray) -> Floats | None:
    """Return an unknown column as float64 (rows,), NaN where it is empty; None if it does not consist of numbers."""
    kind = values.type
    try:
        if pa.types.is_string(kind) or pa.types.is_large_string(kind):
            trimmed = pc.utf8_trim_whitespace(values)
            values = pc.if_else(pc.equal(trimmed, ""), None, trimmed)
        elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind)):
            return None
        return np.asarray(values.cast(pa.float64(), safe=False).fill_null(np.nan).to_numpy(), dtype=np.float64)
    except pa.ArrowException:
        return None


def _absent(name: str, names: Sequence[str], where: object) -> CampaignError:
    close = difflib.get_close_matches(name, names, 1)
    found = f"it has {', '.join(names[:12])}{', …' if len(names) > 12 else ''}"
    remedy = f"rename its column {close[0]}" if close else "add it (docs/reference/campaign-directory.md)"
    return CampaignError(f"has no column {name} ({found})", where=where, remedy=remedy)


def _convert(values: pa.ChunkedArray, column: ColumnSpec, where: object) -> pa.ChunkedArray:
    target, kind = _TYPES[column.kind], values.type
    if pa.types.is_null(kind):
        return values.cast(target)
    if column.kind == "text":
        if pa.types.is_integer(kind) or pa.types.is_large_string(kind) or kind == pa.string_view():
            return values.cast(target)
        raise _wrong_type(column, where, kind)
    if pa.types.is_large_string(kind) or pa.types.is_string(kind) or kind == pa.string_view():
        return _parse(values.cast(pa.string()), column, where)
    if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind)):
        raise _wrong_type(column, where, kind)
    if column.kind != "number" and pa.types.is_floating(kind):
        values = pc.if_else(pc.is_nan(values), None, values)
    try:
        return values.cast(target, safe=column.kind == "count")
    except pa.ArrowInvalid:
        raise _bad_cell(values, column, where, lambda cell: float(cell).is_integer()) from None


def _parse(values: pa.ChunkedArray, column: ColumnSpec, where: object) -> pa.ChunkedArray:
    values = pc.utf8_trim_whitespace(values)
    values = pc.if_else(pc.equal(values, ""), None, values)
    try:
        return values.cast(_TYPES[column.kind])
    except pa.ArrowInvalid:
        raise _bad_cell(values, column, where, _PARSERS[column.kind]) from None


def _as_flag(cell: str) -> bool:
    return {"true": True, "false": False, "1": True, "0": False}[cell.lower()]


_PARSERS: dict[Kind, Callable[[str], object]] = {"text": str, "number": float, "count": int, "flag": _as_flag}


def _fill(values: pa.ChunkedArray, column: ColumnSpec, where: object) -> pa.ChunkedArray:
    if column.kind == "number":
        return values.fill_null(float("nan"))
    if column.kind == "flag":
        return values.fill_null(False)
    if not column.required:
        return values.fill_null(UNKNOWN_COUNT) if column.kind == "count" else values
    if column.kind == "text" and column.name != "run_id":
        return values.fill_null("")
    row = pc.index(pc.is_null(values), True).as_py() + 1
    raise CampaignError(f"row {row} has no {column.name}", where=where, remedy=f"fill in {column.name}")


def _wrong_type(column: ColumnSpec, where: object, kind: pa.DataType) -> CampaignError:
    return CampaignError(
        f"column {column.name} has the wrong type",
        where=where,
        value=str(kind),
        limit=_WORDS[column.kind],
        remedy="convert it",
    )


def _bad_cell(values: Any, column: ColumnSpec, where: object, accepts: Callable[[Any], object]) -> CampaignError:
    for row, cell in enumerate(values.to_pylist(), start=1):
        try:
            good = cell is None or accepts(cell) is not False or cell is False
        except (ValueError, KeyError, OverflowError):
            good = False
        if not good:
            remedy = "use a decimal point" if _has_decimal_comma(cell) else "correct the cell"
            return CampaignError(
                f"row {row}: {column.name} is not {_WORDS[column.kind]}",
                where=where,
                value=_short(repr(cell)),
                remedy=remedy,
            )
    return _wrong_type(column, where, values.type)


def _short(text: str) -> str:
    """Return text that fits a line: a cell may hold the rest of its file, if a quote is not closed."""
    return text if len(text) <= _LONGEST_VALUE else f"{text[:_LONGEST_VALUE]}…"


def _has_decimal_comma(cell: object) -> bool:
    return isinstance(cell, str) and cell.count(",") == 1 and cell.replace(",", "").strip("+- ").isdigit()
