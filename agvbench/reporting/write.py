"""Write a report: HTML, Markdown, tables as CSV and LaTeX, a recording for the Rerun viewer; a diagnosis as HTML."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from agvbench.campaign import Campaign
from agvbench.campaign.arguments import as_campaign
from agvbench.campaign.atomic_files import made_folder, replace_whole
from agvbench.errors import FileError, RecordingError
from agvbench.metrics.table import write_metrics
from agvbench.reporting.content import Content, plain
from agvbench.reporting.drawn_sections import drawn_sections
from agvbench.reporting.pages import to_html, to_markdown
from agvbench.reporting.progress import track
from agvbench.reporting.recording import recorder
from agvbench.reporting.sections.diagnosis import DiagnosisSection, diagnosis_blocks
from agvbench.reporting.table_files import frame_to_csv, to_csv, to_latex
from agvbench.running.configuration.lab_file import LabFile
from agvbench.statistics.comparison import MARGIN_DEG, MARGIN_MM
from agvbench.statistics.uncertainty.tables import budgets_to_json, component_table
from agvbench.workflows.diagnosis_files import shown
from agvbench.workflows.output_files import write_file
from agvbench.workflows.report import ReportData, gather

if TYPE_CHECKING:
    from agvbench.diagnosis import Diagnosis

HTML, MARKDOWN, TABLES = "report.html", "report.md", "tables"


def page_texts(title: str, subtitle: str, sections: Sequence[Content], out: Path) -> Iterator[tuple[str, str]]:
    """Yield the name of each file, in the directory `out`, and its text."""
    yield HTML, to_html(title, subtitle, sections, beside=out)
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
    against: str | Path | None = None,
    uncertainty: str | Path | None = None,
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
    against
        The campaign to list differences from; without it, the last earlier one of this vehicle in the same folder.
    uncertainty
        A TOML file with a table ``[uncertainty]``, such as ``lab.toml``; without it, that of the campaign counts.

    Raises
    ------
    InputError
        If `campaign` is neither.
    CampaignError
        If the campaign cannot be read.
    FileError
        If `out` cannot be written, `uncertainty` not be read, or an own section not be drawn.
    """
    opened = as_campaign(campaign)
    out = opened.path / "report" if out is None else Path(out)
    stated = None if uncertainty is None else LabFile.load(Path(uncertainty)).uncertainty
    with recorder(opened, out / RECORDING) if recording else nullcontext(lambda _: None) as record:
        data = gather(
            opened,
            track=lambda runs, total: track(runs, total, what="reading runs"),
            on_read=record,
            margin_mm=margin_mm,
            margin_deg=margin_deg,
            against=None if against is None else Path(against),
            uncertainty=stated,
        )
        written = write_gathered(data, out)
    return replace(written, files=[*written.files, out / RECORDING]) if recording else written


def write_gathered(data: ReportData, out: str | Path | None = None) -> WrittenReport:
    """Write the report of a campaign that was gathered already; parameters and errors are those of `write_report`."""
    out = data.path / "report" if out is None else Path(out)
    with suppress(RecordingError):
        write_metrics(data.path, data.metrics)
    try:
        sections = drawn_sections(data)
        with made_folder(out):
            files = [_write(out / name, text) for name, text in _texts(data, sections, out)]
    except OSError as error:
        why = error.strerror or str(error)
        raise FileError(f"cannot be written ({why})", where=out, remedy="choose another directory with --out") from None
    return WrittenReport(data, sections, files)


def subtitle_of(data: ReportData) -> str:
    """Return the vehicle, the number of runs, and the labels."""
    labels = ", ".join(f"{name} {value}" for name, value in data.header.labels.items())
    return " · ".join(filter(None, [plain(data.header.vehicle_name), f"{len(data.runs)} runs", plain(labels)]))


def _texts(data: ReportData, sections: Sequence[Content], out: Path) -> Iterator[tuple[str, str]]:
    yield from page_texts(plain(data.header.name), subtitle_of(data), sections, out)
    yield f"{TABLES}/pose_errors.csv", frame_to_csv(data.errors)
    yield f"{TABLES}/metrics.csv", frame_to_csv(data.metrics)
    yield f"{TABLES}/uncertainty_components_all.csv", frame_to_csv(component_table(data.budgets))
    yield f"{TABLES}/uncertainty.json", budgets_to_json(data.budgets)


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
