"""One HTML file that holds everything: no scripts, no fonts, no pictures from elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from agvbench.reporting.content import Bullets, Column, Content, FigureBlock, Paragraph, Table
from agvbench.reporting.figures.style import MARKERS
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
    environment.filters["spans"] = _spans
    environment.filters["shape"] = lambda index: _SHAPES[MARKERS[index % len(MARKERS)]]
    template = environment.get_template("report.html.j2")
    return template.render(title=title, subtitle=subtitle, sections=sections)


def _spans(columns: Sequence[Column]) -> list[tuple[str, int]]:
    """Return the groups that columns stand in, with how many columns each spans; none where there are no groups."""
    if not any(column.group for column in columns):
        return []
    return [(group, len(list(members))) for group, members in groupby(columns, key=lambda c: c.group)]
