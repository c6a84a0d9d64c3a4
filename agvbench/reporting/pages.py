"""Report pages: one HTML file with nothing from elsewhere, readable without its script; and sections as Markdown."""

from __future__ import annotations

import html
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import quote

from agvbench.plot.style import MARKERS
from agvbench.reporting.content import Block, Bullets, Content, FigureBlock, Fold, Links, Paragraph, Table, spans
from agvbench.resources import resource_directory

_SHAPES = {"o": "●", "s": "■", "^": "▲", "D": "◆", "v": "▼", "P": "✚"}


def to_html(title: str, subtitle: str, sections: Sequence[Content], *, beside: Path | None = None) -> str:
    """Return the report as one HTML document.

    Everything is escaped but the drawings, which `agvbench.reporting.figures` made. Links to files of the directory
    that holds `beside`, the directory of the document, are relative to it; others are absolute.
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
        "links": lambda block: isinstance(block, Links),
        "fold": lambda block: isinstance(block, Fold),
    }
    environment.filters["spans"] = spans
    environment.filters["labelled"] = _labelled
    environment.filters["address"] = lambda file: file_address(file, beside)
    environment.filters["shape"] = lambda index: _SHAPES[MARKERS[index % len(MARKERS)]]
    template = environment.get_template("report.html.j2")
    return template.render(title=title, subtitle=subtitle, sections=sections)


def file_address(file: Path, beside: Path | None) -> str:
    """Return the address of a file for a link: relative if it lies in the directory that holds `beside`.

    >>> file_address(Path("/c/tonight/poses.parquet/a b.parquet"), Path("/c/tonight/report"))
    '../poses.parquet/a%20b.parquet'
    >>> file_address(Path("/c/tonight/poses.csv"), Path("/home/lab/report"))
    'file:///c/tonight/poses.csv'
    """
    file = file.absolute()
    if beside is not None and file.is_relative_to(beside.absolute().parent):
        return quote(Path(os.path.relpath(file, beside.absolute())).as_posix())
    return file.as_uri()


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
        case Links(files):
            yield from (f"- {escape(words)}: {escape(str(file))}" for words, file in files)
        case Fold(summary, blocks):
            yield f"**{escape(summary)}**"
            for inner in blocks:
                yield ""
                yield from _block(inner)
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
