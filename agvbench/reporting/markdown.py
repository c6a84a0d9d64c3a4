"""Report sections as Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from agvbench.reporting.content import Block, Bullets, Content, FigureBlock, Paragraph, Table

_SPECIAL = re.compile(r"([\\`*_{}\[\]<>#|~$!])")


def to_markdown(title: str, sections: Sequence[Content]) -> str:
    """Return the whole report as Markdown; figures are left to the HTML file."""
    lines = [f"# {escape(title)}", ""]
    for section in sections:
        lines += [f"## {escape(section.title)}", ""]
        for block in section.blocks:
            lines += [*_block(block), ""]
    return "\n".join(lines)


def escape(text: str) -> str:
    r"""Return `text` so that Markdown shows it as it is, on one line.

    >>> escape("a|b <script>")
    'a\\|b \\<script\\>'
    """
    return _SPECIAL.sub(r"\\\1", " ".join(text.split()))


def _block(block: Block) -> Iterator[str]:
    match block:
        case Paragraph(text, lead):
            yield f"**{escape(text)}**" if lead else escape(text)
        case Bullets(items):
            yield from (f"- {escape(item)}" for item in items)
        case Table():
            yield from _table(block)
        case FigureBlock(caption=caption):
            yield f"*Figure (in report.html): {escape(caption)}*"


def _table(table: Table) -> Iterator[str]:
    yield from (escape(table.caption), "")
    titles = [f"{c.group}: {c.title}" if c.group else c.title for c in table.columns]
    yield _line([escape(title) for title in titles])
    yield _line(["---" if c.digits is None else "---:" for c in table.columns])
    yield from (_line([escape(cell) for cell in row]) for row in table.shown_rows())
    if table.note:
        yield from ("", escape(table.note))


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"
