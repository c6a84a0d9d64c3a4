"""Tables as files: CSV in full precision, safe to open in a spreadsheet; LaTeX (booktabs)."""

from __future__ import annotations

import csv
import io
import math
import unicodedata
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from agvbench.reporting.content import Column, Table, Value, plain, spans

if TYPE_CHECKING:
    import pandas as pd


def to_csv(table: Table) -> str:
    """Return `table` as CSV (UTF-8, comma, point)."""
    return _csv([column.name for column in table.columns], [list(row) for row in table.rows])


def frame_to_csv(frame: pd.DataFrame) -> str:
    """Return a data frame as CSV in the same form."""
    return _csv([str(name) for name in frame.columns], frame.to_numpy(dtype=object).tolist())


def _csv(header: list[str], rows: list[list[Value]]) -> str:
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow([_cell(name) for name in header])
    writer.writerows([_cell(value) for value in row] for row in rows)
    return file.getvalue()


def _cell(value: Value) -> Value:
    """Return the value; text that a spreadsheet would take for a formula gets an apostrophe before it."""
    if isinstance(value, float) and math.isnan(value):
        return ""
    if not isinstance(value, str):
        return value
    text = plain(value)
    # Spreadsheets may read full-width and superscript signs as the ASCII ones.
    return f"'{text}" if unicodedata.normalize("NFKC", text[:1]) in {"=", "+", "-", "@"} else text


_SYMBOLS = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "|": r"\textbar{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    '"': r"\textquotedbl{}",
    "Δ": r"$\Delta$",
    "δ": r"$\delta$",
    "°": r"\textdegree{}",
    "−": "$-$",
    "→": r"$\to$",
    "±": r"$\pm$",
    "×": r"$\times$",
    "∞": r"$\infty$",
    "µ": r"\textmu{}",
    "·": r"\textperiodcentered{}",
    "…": r"\dots{}",
    "–": "--",
    "\u201c": "``",
    "\u201d": "''",
    "\ufffd": "?",
}
_SPECIAL = {c: f"\\{c}" for c in "&%$#_{}"} | _SYMBOLS


def to_latex(table: Table) -> str:
    r"""Return `table` as a ``table`` environment that needs the packages booktabs and textcomp."""
    lines = [
        "% needs \\usepackage{booktabs,textcomp}",
        "\\begin{table}",
        "\\centering\\footnotesize",
        f"\\caption{{{escape(table.caption)}}}",
        f"\\label{{tab:{table.slug}}}",
        f"\\begin{{tabular}}{{{''.join('l' if c.digits is None else 'r' for c in table.body_columns)}}}",
        "\\toprule",
        *_head(table.body_columns),
        "\\midrule",
        *_body(table),
        "\\bottomrule",
        "\\end{tabular}",
        "\\end{table}",
    ]
    return "\n".join(lines) + "\n"


def escape(text: str) -> str:
    r"""Return `text` so that LaTeX sets it as it is.

    >>> escape("50 % of {a_b}")
    '50 \\% of \\{a\\_b\\}'
    """
    return "".join(_SPECIAL.get(c, c) for c in text)


def _head(columns: Sequence[Column]) -> Iterator[str]:
    if groups := spans(columns):
        yield _line(
            [f"\\multicolumn{{{n}}}{{c}}{{{escape(group)}}}" if group else " & " * (n - 1) for group, n in groups]
        )
    yield _line([escape(column.title) for column in columns])


def _body(table: Table) -> Iterator[str]:
    for heading, rows in table.groups():
        if heading:
            yield _line([f"\\multicolumn{{{len(table.body_columns)}}}{{l}}{{\\textbf{{{escape(heading)}}}}}"])
        yield from (_line([escape(cell) for cell in row]) for row in rows)


def _line(cells: Sequence[str]) -> str:
    return " & ".join(cells) + r" \\"
