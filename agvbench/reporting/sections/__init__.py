"""The sections of a report, one per file: a new file with a `Section` in it joins every report and every test."""

from __future__ import annotations

from agvbench.registry import classes_by_file
from agvbench.reporting.sections.base import Section

__all__ = ["Section", "all_sections"]


def all_sections() -> list[Section]:
    """Return one of each section, in the order of a report."""
    found = classes_by_file(__name__, Section)  # type: ignore[type-abstract]
    return sorted((section() for section in found), key=lambda section: section.order)
