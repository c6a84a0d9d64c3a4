"""The last words of a bench session: the summary, and where campaign and report are."""

from __future__ import annotations

from pathlib import Path

from agvbench.reporting.dry_run import dry_run_table

__all__ = ["conclude", "dry_run_table"]


def conclude(directory: Path, *, report: bool) -> str:
    """Return the summary of the campaign in `directory`, after writing its report where that is wanted."""
    return f"campaign: {directory}"
