"""What a section is made of, before it becomes HTML, Markdown, LaTeX, CSV or a console table."""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

Value = str | float | int | None
_LONGEST = 120


@dataclass(frozen=True)
class Column:
    """A column: its name in CSV, its title for people, decimals of its numbers (None: text), and a group of columns.

    Numbers below ``least`` are shown as less than it (p-values). ``explained`` says in a sentence what the column has.
    """

    name: str
    title: str
    digits: int | None = None
    group: str = ""
    least: float = -math.inf
    explained: str = ""

    def shown(self, value: Value) -> str:
        """Return `value` as people read it: rounded, with a real minus sign, empty where there is none."""
        if value is None or (isinstance(value, float) and math.isnan(value)):
            return ""
        if self.digits is None or isinstance(value, str):
            return plain(str(value))
        if math.isinf(value):
            return "∞" if value > 0 else "−∞"
        if value < self.least:
            return f"<{self.least:.{self.digits}f}"
        text = f"{value:.{self.digits}f}"
        return text.removeprefix("-") if float(text) == 0.0 else text.replace("-", "−")


def spans(columns: Sequence[Column]) -> list[tuple[str, int]]:
    """Return the groups that columns stand in, with how many columns each spans; none where there are no groups."""
    if not any(column.group for column in columns):
        return []
    return [(group, len(list(members))) for group, members in groupby(columns, key=lambda c: c.group)]


@dataclass(frozen=True)
class Table:
    """Rows under columns. The first column's value heads a group of rows where ``grouped``.

    ``files`` are those of the rows, one each, where rows have files; the first cell links to it, unless ``grouped``.
    """

    slug: str
    caption: str
    columns: Sequence[Column]
    rows: Sequence[Sequence[Value]]
    grouped: bool = False
    note: str = ""
    files: Sequence[Path] = ()

    def shown_rows(self) -> list[list[str]]:
        """Return every cell as people read it."""
        return [[c.shown(v) for c, v in zip(self.columns, row, strict=True)] for row in self.rows]

    def groups(self) -> list[tuple[str, list[list[str]]]]:
        """Return the shown rows by their heading; one group without heading where the table is not grouped."""
        if not self.grouped:
            return [("", self.shown_rows())]
        groups: dict[str, list[list[str]]] = {}
        for row in self.shown_rows():
            groups.setdefault(row[0], []).append(row[1:])
        return list(groups.items())

    @property
    def body_columns(self) -> Sequence[Column]:
        """Return the columns that stand beside each other: without the one that heads groups."""
        return self.columns[1:] if self.grouped else self.columns


@dataclass(frozen=True)
class Panel:
    """One drawing of a figure: an SVG element made by this package, and a title."""

    title: str
    svg: str


@dataclass(frozen=True)
class FigureBlock:
    """Panels beside each other, as many as fit; ``legend`` pairs names with the number of a condition's colour.

    Panels are ``wide`` or ``small`` or neither.
    """

    slug: str
    caption: str
    panels: Sequence[Panel]
    legend: Sequence[tuple[str, int]] = ()
    wide: bool = False
    small: bool = False


@dataclass(frozen=True)
class Paragraph:
    """A sentence or a few; ``lead`` is the one to read if only one is read."""

    text: str
    lead: bool = False


@dataclass(frozen=True)
class Bullets:
    """Sentences of equal standing."""

    items: Sequence[str]


@dataclass(frozen=True)
class Links:
    """Files that belong to a page, each with the words for it."""

    files: Sequence[tuple[str, Path]]


@dataclass(frozen=True)
class Fold:
    """Blocks below a summary, which a reader opens; ``sketch`` is a small SVG beside the summary."""

    summary: str
    blocks: Sequence[Block]
    sketch: str = ""


Block = Paragraph | Bullets | Table | FigureBlock | Links | Fold


def tables_in(blocks: Sequence[Block]) -> list[Table]:
    """Return the tables among blocks, folded ones too, in their order."""
    found: list[Table] = []
    for block in blocks:
        found += [block] if isinstance(block, Table) else tables_in(block.blocks) if isinstance(block, Fold) else []
    return found


@dataclass(frozen=True)
class Content:
    """A section ready to be rendered."""

    slug: str
    title: str
    blocks: Sequence[Block] = ()

    @property
    def is_absent(self) -> bool:
        """Whether all that the section says is why it has nothing to show."""
        return all(isinstance(block, Paragraph) and not block.lead for block in self.blocks)

    @property
    def tables(self) -> list[Table]:
        """Return the section's tables, folded ones too."""
        return tables_in(self.blocks)


def plain(text: str) -> str:
    r"""Return `text` on one line, without control characters, and not longer than a line.

    Names come from campaigns, which anyone may have written.

    >>> plain("slalom\x1b\n 2") == "slalom\ufffd 2"
    True
    """
    kept = text if text.isprintable() else "".join(map(_shown, text))
    line = " ".join(kept.split())
    return line if len(line) <= _LONGEST else f"{line[: _LONGEST - 1]}…"


def _shown(character: str) -> str:
    is_control = unicodedata.category(character) in {"Cc", "Cf", "Cs"} and not character.isspace()
    return "\ufffd" if is_control else character


def plain_sentences(text: str) -> str:
    """Return `text` on one line without control characters, of whatever length."""
    return " ".join(plain(word) for word in text.split())
