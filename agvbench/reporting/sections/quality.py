"""How the runs went: rejected runs and why, lost frames, gaps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from agvbench.reporting.content import Block, Bullets, Column, Paragraph, Table, Value, plain
from agvbench.reporting.sections.base import Section
from agvbench.types import Outcome
from agvbench.workflows.report import ReportData

_COLUMNS = (
    Column("experiment", "experiment"),
    Column("condition", "condition"),
    Column("runs", "runs", 0),
    Column("ok", "ok", 0),
    Column("rejected", "rejected", 0),
    Column("aborted", "aborted", 0),
    Column("lost_share_percent", "median", 2, group="frames lost [%]"),
    Column("worst_lost_share_percent", "worst run", 2, group="frames lost [%]"),
    Column("longest_gap_ms", "longest gap [ms]", 0),
    Column("doubled_frames", "doubled frames", 0),
)
_MOST_REASONS = 12


class QualitySection(Section):
    """One table, and the reasons why runs do not count."""

    slug, title, order = "quality", "Run quality", 90

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return the table and the reasons."""
        groups = data.quality.groupby(["experiment", "condition"], sort=False)
        rows: list[list[Value]] = []
        for (experiment, condition), group in groups:
            ok = group["status"] == "ok"
            rejected = group["status"].str.startswith(Outcome.REJECTED)
            rows.append(
                [
                    *(str(experiment), str(condition), len(group), int(ok.sum()), int(rejected.sum())),
                    int(len(group) - ok.sum() - rejected.sum()),
                    100.0 * float(group["lost_share"].median()),
                    100.0 * float(group["lost_share"].max()),
                    1e3 * float(group["longest_gap_s"].max()),
                    int(group["doubled"].sum()),
                ]
            )
        table = Table("run_quality", "All runs, counted by experiment and condition.", _COLUMNS, rows)
        reasons = list(_reasons(data))
        if not reasons:
            return [table, Paragraph("Every run counts.")]
        return [table, Paragraph("Runs that do not count, and why:"), Bullets(reasons)]


def _reasons(data: ReportData) -> Iterator[str]:
    # Numbers differ from run to run: what stands before them distinguishes the reasons.
    bad = [status for status in data.quality["status"] if status != "ok"]
    bad += [f"no error: {problem}" for problem in data.errors["problem"][data.errors["status"] == "ok"] if problem]
    counts = Counter(plain(reason) for reason in bad)
    for reason, count in counts.most_common(_MOST_REASONS):
        yield f"{count} × {reason}"
    if len(counts) > _MOST_REASONS:
        yield f"and {sum(counts.values()) - sum(n for _, n in counts.most_common(_MOST_REASONS))} more"
