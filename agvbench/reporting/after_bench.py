"""The last words of a bench session: the summary, and where campaign and report are."""

from __future__ import annotations

from pathlib import Path

from rich.console import Group, RenderableType
from rich.text import Text

from agvbench.errors import AgvbenchError
from agvbench.reporting.console import end_pose_summary, said_first
from agvbench.reporting.text import as_text
from agvbench.reporting.write import write_report
from agvbench.statistics.quantities import DEFINITIONS
from agvbench.workflows.report import ReportData, gather


def conclude(directory: Path, *, report: bool) -> str:
    """Return the summary of the campaign in `directory`, after writing its report where that is wanted.

    What cannot be reported is said, not raised: the campaign is recorded all the same.
    """
    try:
        if not report:
            defined = Text(f"{DEFINITIONS}\n")
            return as_text(Group(*_end_poses(gather(directory), defined), Text(f"campaign: {directory}")))
        written = write_report(directory)
    except AgvbenchError as error:
        return f"no report: {error}\ncampaign: {directory}"
    where = [Text(f"campaign: {directory}"), Text(f"report:   {written.files[0]}")]
    return as_text(Group(*_end_poses(written.data), *said_first(written), Text(""), *where))


def _end_poses(data: ReportData, *below: RenderableType) -> list[RenderableType]:
    """Return the table of end poses and what stands below it, or nothing where no run had a target."""
    return [end_pose_summary(data), *below] if len(data.end_poses) else []
