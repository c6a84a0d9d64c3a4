"""A diagnosis as one HTML file."""

from __future__ import annotations

from pathlib import Path

from agvbench.diagnosis import Diagnosis
from agvbench.reporting.content import Content, plain
from agvbench.reporting.pages import to_html
from agvbench.reporting.sections.diagnosis import DiagnosisSection, diagnosis_blocks
from agvbench.workflows.diagnosis_files import shown
from agvbench.workflows.output_files import write_file


def write_diagnosis_report(found: Diagnosis, path: str | Path) -> Path:
    """Write what was found, with pictures of the residual before and after, into the HTML file `path`.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    path = Path(path)
    section = Content(DiagnosisSection.slug, DiagnosisSection.title, tuple(diagnosis_blocks(shown(found))))
    title = plain(str(found.provenance.get("campaign", "diagnosis")))
    text = to_html(title, f"{found.verdict}: diagnosis of {found.provenance.get('runs_used', 0)} runs", [section])
    write_file("--report", path, lambda page: page.write_text(text, encoding="utf-8"))
    return path
