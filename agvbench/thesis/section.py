"""Sections and tables as data, for console, Markdown, CSV or JSON; printed figures beside recomputed ones."""

from __future__ import annotations

import csv
import io
import math
import re
from dataclasses import dataclass, field
from decimal import Decimal

Cell = str | float | int | bool | None


@dataclass(frozen=True)
class ThesisTable:
    """A table: `columns` are headings, ``rows[i][j]`` the cells; `name` is a file name without its ending.

    `narrow_columns` are shorter headings for a terminal, explained by the note; an empty one is not shown there.
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""
    narrow_columns: tuple[str, ...] = ()
    digits: int = 4

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"table {self.name}: {len(row)} cells under {len(self.columns)} columns: {row}")

    def records(self) -> list[dict[str, Cell]]:
        """Return one mapping per row, with keys that programs can rely on (``"Δs [mm]"`` becomes ``"delta_s_mm"``)."""
        keys = [key_of(column) for column in self.columns]
        return [{k: _json_cell(c) for k, c in zip(keys, row, strict=True)} for row in self.rows]

    def csv(self) -> str:
        """Return the table as CSV with full precision."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow([key_of(column) for column in self.columns])
        writer.writerows([["" if c is None else c for c in row] for row in self.rows])
        return text.getvalue()

    def markdown(self) -> str:
        """Return the table as Markdown, cells rounded for reading."""
        head = "| " + " | ".join(_escape(c) for c in self.columns) + " |"
        rule = "|" + "---|" * len(self.columns)
        body = ["| " + " | ".join(_escape(show(c, self.digits)) for c in row) + " |" for row in self.rows]
        note = ["", self.note] if self.note else []
        return "\n".join([f"**{self.title}**", "", head, rule, *body, *note, ""])


@dataclass(frozen=True)
class ThesisSection:
    """A part of the answer: what was found in plain words, and the tables it rests on."""

    name: str
    title: str
    findings: tuple[str, ...]
    tables: tuple[ThesisTable, ...]
    values: dict[str, Cell] = field(default_factory=dict)

    def markdown(self) -> str:
        """Return the section as Markdown."""
        lines = [f"## {self.title}", "", *(f"- {finding}" for finding in self.findings), ""]
        return "\n".join(lines + [table.markdown() for table in self.tables])

    def as_json(self) -> dict[str, object]:
        """Return the section as plain data."""
        return {
            "title": self.title,
            "findings": list(self.findings),
            "values": {k: _json_cell(v) for k, v in self.values.items()},
            "tables": {table.name: table.records() for table in self.tables},
        }


_GREEK = {"Δ": "delta_", "δ": "delta_", "²": "2", "°": "deg", "µ": "u", "|": "", "%": "percent", "±": "", "−": "minus_"}


def key_of(heading: str) -> str:
    """Return a heading as an identifier.

    >>> key_of("Δs [mm]"), key_of("held-out rms [deg]"), key_of("R²")
    ('delta_s_mm', 'held_out_rms_deg', 'r2')
    """
    text = "".join(_GREEK.get(character, character) for character in heading.lower().replace("m/s", "mps"))
    return re.sub(r"[^0-9a-z]+", "_", text).strip("_")


def show(cell: Cell, digits: int = 4) -> str:
    """Return a cell for reading: so many significant digits, yes and no for truth values.

    >>> show(0.9990961), show(True), show(None), show(298770.0), show(3.7419443e-09)
    ('0.9991', 'yes', '–', '298770', '3.742e-09')
    """
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "–"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if not isinstance(cell, float):
        return str(cell)
    return f"{cell:.0f}" if abs(cell) >= 1000.0 else f"{cell:.{digits}g}"


def _json_cell(cell: Cell) -> Cell:
    return None if isinstance(cell, float) and not math.isfinite(cell) else cell


def _escape(text: str) -> str:
    return text.replace("|", "\\|")


COLUMNS = ("figure", "where", "thesis", "ours", "agree", "remark")


@dataclass(frozen=True)
class Figure:
    """A figure as the thesis prints it (`printed`, a decimal with a point) beside ours.

    It agrees when ours, rounded to the printed decimals, is the printed one; `tolerance_units` allows for
    inputs that were themselves printed rounded, in units of the last printed decimal.
    """

    what: str
    where: str
    printed: str
    ours: float
    remark: str = ""
    tolerance_units: float = 0.5

    @property
    def agrees(self) -> bool:
        """Whether ours rounds to the printed figure.

        >>> Figure("R²", "table 7.5", "0.9991", 0.99909596).agrees
        True
        >>> Figure("slope", "eq. 7.1", "-0.0840", -0.0861).agrees
        False
        """
        printed = Decimal(self.printed)
        unit = Decimal(1).scaleb(int(printed.as_tuple().exponent))
        return abs(Decimal(repr(float(self.ours))) - printed) <= Decimal(str(self.tolerance_units)) * unit

    def row(self) -> tuple[Cell, ...]:
        """Return the cells under `COLUMNS`."""
        return (self.what, self.where, self.printed, float(self.ours), self.agrees, self.remark)


def figures_table(name: str, title: str, figures: list[Figure], note: str = "") -> ThesisTable:
    """Return a table of figures."""
    return ThesisTable(name, title, COLUMNS, tuple(figure.row() for figure in figures), note, digits=6)
