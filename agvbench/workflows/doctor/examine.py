"""Runs every check, one after another."""

from __future__ import annotations

from collections.abc import Iterator

from agvbench.errors import AgvbenchError
from agvbench.registry import classes_by_file
from agvbench.workflows.doctor import checks
from agvbench.workflows.doctor.finding import Check, Finding, FindingState, Lab


def examine(lab: Lab) -> Iterator[tuple[str, Finding]]:
    """Give each check's name and finding, in the order of their files."""
    for cls in classes_by_file(checks, Check):  # type: ignore[type-abstract]
        try:
            finding = cls().examine(lab)
        except AgvbenchError as error:
            finding = Finding(FindingState.BAD, str(error))
        yield cls.name, finding
