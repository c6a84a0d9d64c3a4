"""The sections of a report, one per file: a new file with a `Section` in it joins every report and every test.

A lab's own sections are files of the folder ``report_sections`` of the current folder.
"""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

from agvbench.errors import FileError
from agvbench.own_modules import OwnModules, shown_file
from agvbench.registry import classes_by_file, own_classes
from agvbench.reporting.sections.base import Section

__all__ = ["OWN_SECTIONS", "Section", "all_sections"]

OWN_SECTIONS = OwnModules(
    "report_sections", "agvbench.reporting", "agvbench_own_sections", "docs/how-to/add-a-report-section.md"
)
"""Sections of a lab: the files of the folder ``report_sections`` in the current folder that import this package."""


def all_sections() -> list[Section]:
    """Return one of each section, in the order of a report; of equal order, own ones come after those that ship.

    Raises
    ------
    FileError
        If a file of the lab cannot be imported, has no section, or one without an attribute or with a taken slug.
    """
    found = [section() for section in classes_by_file(__name__, Section)]  # type: ignore[type-abstract]
    taken = {section.slug for section in found}
    for module in _own_modules():
        for section in _sections_in(module):
            if section.slug in taken:
                raise _refused(module, "there is a section of this slug", section.slug, "rename it")
            taken.add(section.slug)
            found.append(section)
    return sorted(found, key=lambda section: section.order)


def _own_modules() -> list[ModuleType]:
    try:
        return OWN_SECTIONS.load()
    except FileError:
        raise
    except Exception as error:
        raise OWN_SECTIONS.import_error(error, Path(__file__).parent) from error


def _sections_in(module: ModuleType) -> list[Section]:
    classes = own_classes(module, Section)  # type: ignore[type-abstract]
    if not classes:
        raise _refused(module, "has no section", "", "derive a class from agvbench.reporting.sections.Section")
    sections = []
    for cls in classes:
        try:
            sections.append(cls().checked())
        except (TypeError, ValueError) as error:
            raise _refused(module, f"section {cls.__name__}: {error}", "", "add or correct it") from None
    return sections


def _refused(module: ModuleType, what: str, value: str, remedy: str) -> FileError:
    advice = f"{remedy}; see {OWN_SECTIONS.how_to}"
    return FileError(what, where=shown_file(str(module.__file__)), value=value or None, remedy=advice)
