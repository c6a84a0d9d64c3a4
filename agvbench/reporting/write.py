"""Write a report: HTML, Markdown, tables as CSV and LaTeX, a recording for the Rerun viewer; a diagnosis as HTML."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from agvbench.campaign import Campaign
from agvbench.campaign.arguments import as_campaign
from agvbench.campaign.atomic_files import made_folder, replace_whole
from agvbench.diagnosis import Diagnosis
from agvbench.errors import FileError, RecordingError
from agvbench.metrics.table import write_metrics
from agvbench.reporting.content import Content, plain
from agvbench.reporting.pages import to_html, to_markdown
from agvbench.reporting.progress import track
from agvbench.reporting.recording import write_recording
from agvbench.reporting.sections import all_sections
from agvbench.reporting.sections.diagnosis import DiagnosisSection, diagnosis_blocks
from agvbench.reporting.table_files import frame_to_csv, to_csv, to_latex
from agvbench.statistics.comparison import MARGIN_DEG, MARGIN_MM
from agvbench.workflows.diagnosis_files import shown
from agvbench.workflows.output_files import write_file
from agvbench.workflows.report import ReportData, gather

HTML, MARKDOWN, TABLES = "report.html", "report.md", "tables"


def page_texts(title: str, subtitle: str, sections: Sequence[Content]) -> Iterator[tuple[str, str]]:
    """Yield the name of each file, in a directory of its own, and its text."""
    yield HTML, to_html(title, subtitle, sections)
    yield MARKDOWN, to_markdown(title, sections)
    for table in (table for section in sections for table in section.tables):
        yield f"{TABLES}/{table.slug}.csv", to_csv(table)
        yield f"{TABLES}/{table.slug}.tex", to_latex(table)


RECORDING = "campaign.rrd"


@dataclass(frozen=True)
class WrittenReport:
    """What a report says, and the files that say it."""

    data: ReportData
    sections: Sequence[Content]
    files: Sequence[Path]


def write_report(
    campaign: Campaign | str | Path,
    out: str | Path | None = None,
    *,
    margin_mm: float = MARGIN_MM,
    margin_deg: float = MARGIN_DEG,
    recording: bool = True,
) -> WrittenReport:
    """Write the report of `campaign` into the directory `out`, and its metrics as ``errors.parquet`` beside its runs.

    Where the campaign's directory cannot be written, the metrics are in the report alone.

    Parameters
    ----------
    campaign
        A campaign, or its directory.
    out
        Made if it is not there; without it, ``report`` in the campaign directory. Files of an earlier report are
        replaced.
    margin_mm, margin_deg
        The noise band of comparisons between conditions.
    recording
        Whether to write the ``.rrd``, which takes most of the disk space.

    Raises
    ------
    InputError
        If `campaign` is neither.
    CampaignError
        If the campaign cannot be read.
    FileError
        If `out` cannot be written.
    """
    data = gather(
        as_campaign(campaign).path,
        margin_mm=margin_mm,
        margin_deg=margin_deg,
        track=lambda runs, total: track(runs, total, what="reading runs"),
    )
    out = data.path / "report" if out is None else Path(out)
    with suppress(RecordingError):
        write_metrics(data.path, data.metrics)
    try:
        registry = all_sections()
        with made_folder(out):
            sections = [s.content(data) for s in track(registry, len(registry), what="drawing")]
            files = [_write(out / name, text) for name, text in _texts(data, sections)]
            if recording:
                _replace(out / RECORDING, partial(_record, data))
                files.append(out / RECORDING)
    except OSError as error:
        why = error.strerror or str(error)
        raise FileError(f"cannot be written ({why})", where=out, remedy="choose another directory with --out") from None
    return WrittenReport(data, sections, files)


def _record(data: ReportData, path: Path) -> None:
    try:
        write_recording(data, path)
    except RuntimeError as error:  # rerun's word for a full disk
        raise OSError(f"{RECORDING}: {error}") from None


def _texts(data: ReportData, sections: Sequence[Content]) -> Iterator[tuple[str, str]]:
    subtitle = f"{plain(data.header.vehicle_name)} · {len(data.runs)} runs"
    yield from page_texts(plain(data.header.name), subtitle, sections)
    yield f"{TABLES}/pose_errors.csv", frame_to_csv(data.errors)
    yield f"{TABLES}/metrics.csv", frame_to_csv(data.metrics)


def _write(path: Path, text: str) -> Path:
    with made_folder(path.parent):
        _replace(path, lambda file: file.write_text(text, encoding="utf-8"))
    return path


def _replace(path: Path, write: Callable[[Path], object]) -> None:
    """Have `write` write `path`: a device directly, a file of an earlier report by a whole one or not at all."""
    if path.exists() and not path.is_file():
        write(path)
    else:
        replace_whole(path.resolve(), write, durable=False)


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
