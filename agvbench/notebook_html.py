"""HTML for notebooks: a heading, lines and short tables. Everything that is given is text, and is escaped."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape

Cell = str | float | None


def heading_html(text: str, *lines: str) -> str:
    """Return `text` as a heading above `lines`; empty lines are omitted.

    >>> heading_html("car", "a < b", "")
    '<p><strong>car</strong></p><p>a &lt; b</p>'
    """
    return f"<p><strong>{escape(text)}</strong></p>" + "".join(f"<p>{escape(line)}</p>" for line in lines if line)


def table_html(caption: str, columns: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    """Return a table, or nothing if it has no rows.

    Numbers stand to the right, with four digits; None and NaN are a dash.

    >>> table_html("", ["n"], [[1.23456]])
    '<table><thead><tr><th>n</th></tr></thead><tbody><tr><td style="text-align: right">1.235</td></tr></tbody></table>'
    """
    body = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in rows)
    if not body:
        return ""
    head = "".join(f"<th>{escape(column)}</th>" for column in columns)
    above = f"<caption>{escape(caption)}</caption>" if caption else ""
    return f"<table>{above}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _cell(value: Cell) -> str:
    if isinstance(value, str):
        return f'<td style="text-align: left">{escape(value)}</td>'
    return f'<td style="text-align: right">{_number(value)}</td>'


def _number(value: float | None) -> str:
    if value is None or math.isnan(value):
        return "–"
    return str(value) if isinstance(value, int) else f"{value:.4g}"
