"""A page in all its forms: HTML, Markdown, and each of its tables as CSV and LaTeX."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from agvbench.reporting.content import Content
from agvbench.reporting.csv_table import to_csv
from agvbench.reporting.html import to_html
from agvbench.reporting.latex import to_latex
from agvbench.reporting.markdown import to_markdown

HTML, MARKDOWN, TABLES = "report.html", "report.md", "tables"


def page_texts(title: str, subtitle: str, sections: Sequence[Content]) -> Iterator[tuple[str, str]]:
    """Yield the name of each file, in a directory of its own, and its text."""
    yield HTML, to_html(title, subtitle, sections)
    yield MARKDOWN, to_markdown(title, sections)
    for table in (table for section in sections for table in section.tables):
        yield f"{TABLES}/{table.slug}.csv", to_csv(table)
        yield f"{TABLES}/{table.slug}.tex", to_latex(table)
