"""Report pages: one HTML file without scripts, fonts or pictures from elsewhere; and sections as Markdown."""

from __future__ import annotations

import html
import re
from collections.abc import Iterator, Sequence

from agvbench.plot.style import MARKERS
from agvbench.reporting.content import Block, Bullets, Content, FigureBlock, Paragraph, Table, spans
from agvbench.resources import resource_directory

_SHAPES = {"o": "●", "s": "■", "^": "▲", "D": "◆", "v": "▼", "P": "✚"}


def to_html(title: str, subtitle: str, sections: Sequence[Content]) -> str:
    """Return the report as one HTML document.

    Everything is escaped but the drawings, which `agvbench.reporting.figures` made.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(resource_directory("reports") / "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    environment.tests |= {
        "paragraph": lambda block: isinstance(block, Paragraph),
        "bullets": lambda block: isinstance(block, Bullets),
        "table": lambda block: isinstance(block, Table),
        "drawing": lambda block: isinstance(block, FigureBlock),
    }
    environment.filters["spans"] = spans
    environment.filters["labelled"] = _labelled
    environment.filters["shape"] = lambda index: _SHAPES[MARKERS[index % len(MARKERS)]]
    template = environment.get_template("report.html.j2")
    return template.render(title=title, subtitle=subtitle, sections=sections)


def _labelled(svg: str, label: str) -> str:
    """Return a drawing with the text that screen readers say for it."""
    return svg.replace('role="img"', f'role="img" aria-label="{html.escape(label)}"', 1)


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
