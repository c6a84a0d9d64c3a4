"""Compute the sections of `agvbench thesis` and write them to files."""

from __future__ import annotations

import importlib
import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from agvbench.errors import FlagError, OneOf
from agvbench.thesis.section import ThesisSection
from agvbench.workflows.output_files import write_file

SCHEMA = 1

#: Name of a section and the module that makes it, in reading order.
_MODULES = {
    "steering": "refits.steering",
    "drive": "refits.drive",
    "maps": "refits.alternative_maps",
    "cornering": "refits.cornering",
    "battery": "refits.battery",
    "lever_arm": "refits.idle_axle",
    "errata": "errata",
    "prediction": "prediction.scoring",
    "sensitivity": "prediction.sensitivity",
    "turns": "prediction.turns",
    "residuals": "residuals",
}


def section_names() -> tuple[str, ...]:
    """Return the names of all sections, in reading order."""
    return tuple(_MODULES)


def thesis_sections(names: Sequence[str] = ()) -> Iterator[ThesisSection]:
    """Yield the sections of these names in reading order, each as soon as it is computed; all if none is named.

    Raises
    ------
    FlagError
        If a section is unknown.
    """
    for name in names:
        if name not in _MODULES:
            raise FlagError("unknown section", where="--section", value=name, limit=OneOf(_MODULES))
    return (_section(name) for name in _MODULES if not names or name in names)


def _section(name: str) -> ThesisSection:
    module = importlib.import_module(f"{__package__}.{_MODULES[name]}")
    section: ThesisSection = getattr(module, f"{name}_section")()
    return section


def write_json(sections: Sequence[ThesisSection], path: Path) -> None:
    """Write all sections as one JSON file (``schema``, ``sections``).

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    document = {"schema": SCHEMA, "sections": {s.name: s.as_json() for s in sections}}
    _write("--json", path, json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def write_tables(sections: Sequence[ThesisSection], directory: Path) -> list[Path]:
    """Write one CSV per table and ``thesis.md`` with everything; return the paths.

    Raises
    ------
    FileError
        If a file cannot be written.
    """
    files = {f"{table.name}.csv": table.csv() for section in sections for table in section.tables}
    files["thesis.md"] = "\n".join(["# The thesis, refitted and predicted", "", *(s.markdown() for s in sections)])
    for name, text in files.items():
        _write("--out", directory / name, text)
    return [directory / name for name in files]


def _write(flag: str, path: Path, text: str) -> None:
    write_file(flag, path, lambda file: file.write_text(text, encoding="utf-8", newline="\n"))
