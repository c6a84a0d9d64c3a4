"""Where the numbers come from: vehicle, firmware, model, program versions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from agvbench import __version__
from agvbench.reporting.content import Block, Column, Table
from agvbench.reporting.sections.base import Section
from agvbench.running.configuration.provenance import SIMULATED_TIME
from agvbench.workflows.report import ReportData

_COLUMNS = (Column("name", "what"), Column("value", "value"))


class ProvenanceSection(Section):
    """One table."""

    slug, title, order = "provenance", "Provenance", 100

    def blocks(self, data: ReportData) -> Sequence[Block]:
        """Return the table."""
        rows = [[name, value] for name, value in _facts(data) if value]
        return [Table("provenance", "Where these numbers come from.", _COLUMNS, rows)]


def _facts(data: ReportData) -> Iterator[tuple[str, str]]:
    header = data.header
    yield "campaign", header.name
    yield "directory", str(data.path)
    yield "vehicle", header.vehicle_name
    if header.geometry.is_differential:
        yield "kinematics", f"differential, axle {header.rear_axle_m} m behind the markers' centroid"
    else:
        yield "axles before and behind the markers' centroid", f"{header.front_axle_m} m, {header.rear_axle_m} m"
    yield "labels", ", ".join(f"{name} {value}" for name, value in header.labels.items())
    yield "commands", str(header.channels)
    yield "motion capture", f"{header.mocap_rate_hz:g} Hz"
    yield "firmware", _distinct(run.firmware for run in data.runs)
    yield "sessions", _distinct(run.session or "" for run in data.runs)
    yield "runs", f"{len(data.runs)}, over {_how_long(data)}"
    yield "vehicle model", " ".join(filter(None, [data.curves.model_name, data.curves.model_hash]))
    for name, value in data.provenance.items():
        yield name.replace("_", " "), value
    yield "report made by", f"agvbench {__version__}"


def _how_long(data: ReportData) -> str:
    """Return for how long was driven; a simulation drives an hour in some seconds, so it says whose time this is."""
    seconds = max(run.started_s for run in data.runs)
    units = ((86400.0, "days", 3.0), (3600.0, "hours", 3.0), (60.0, "minutes", 0.0))
    words = next(f"{seconds / unit:.0f} {name}" for unit, name, least in units if seconds >= least * unit)
    return f"{words} of simulated time" if data.provenance.get("time") == SIMULATED_TIME else words


def _distinct(names: Iterator[str]) -> str:
    return ", ".join(dict.fromkeys(name for name in names if name))
