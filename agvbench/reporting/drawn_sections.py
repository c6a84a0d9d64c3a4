"""The content of every section of a report; a mistake in a lab's own section is one line with its file and line."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Collection
from pathlib import Path

from agvbench.errors import AgvbenchError, FileError
from agvbench.own_modules import shown_file
from agvbench.reporting.content import Bullets, Content, FigureBlock, Fold, Links, Paragraph, Table
from agvbench.reporting.progress import track
from agvbench.reporting.sections import OWN_SECTIONS, Section, all_sections
from agvbench.workflows.report import ReportData

_BLOCKS = (Paragraph, Bullets, Table, FigureBlock, Links, Fold)


def drawn_sections(data: ReportData, *, but: Collection[str] = ()) -> list[Content]:
    """Return the content of every section in their order, without those of the slugs `but`.

    Raises
    ------
    FileError
        If an own section cannot be loaded or drawn.
    """
    registry = [section for section in all_sections() if section.slug not in but]
    return [_content(section, data) for section in track(registry, len(registry), what="drawing")]


def _content(section: Section, data: ReportData) -> Content:
    if not type(section).__module__.startswith(f"{OWN_SECTIONS.imported_as}."):
        return section.content(data)
    try:
        content = section.content(data)
        _require_blocks(content)
    except AgvbenchError:
        raise
    except Exception as error:
        raise _mistake(section, error) from error
    return content


def _require_blocks(content: Content) -> None:
    for block in content.blocks:
        if not isinstance(block, _BLOCKS):
            raise TypeError(f"{type(block).__name__} is no block")
        if isinstance(block, Table):
            block.shown_rows()


def _mistake(section: Section, error: Exception) -> FileError:
    """Return the error of an own section that raised `error`: its file and line, what was raised."""
    folder = Path(OWN_SECTIONS.folder).absolute()
    own = [frame for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename).parent == folder]
    module = sys.modules[type(section).__module__]
    where = f"{shown_file(own[-1].filename)}:{own[-1].lineno}" if own else shown_file(str(module.__file__))
    said = " ".join(f"{type(error).__name__} {error}".split())
    return FileError(
        f"section {section.slug} cannot be drawn",
        where=where,
        value=said,
        remedy=f"correct it; see {OWN_SECTIONS.how_to}",
    )
