"""The sections of a report, one per file: a new file with a `Section` in it joins every report and every test."""

from __future__ import annotations

import importlib
import pkgutil

from agvbench.reporting.sections.base import Section

__all__ = ["Section", "all_sections"]


def all_sections() -> list[Section]:
    """Return one of each section, in the order of a report."""
    for module in pkgutil.iter_modules(__path__):
        importlib.import_module(f"{__name__}.{module.name}")
    return sorted((section() for section in Section.__subclasses__()), key=lambda section: section.order)
