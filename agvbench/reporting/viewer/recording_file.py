"""The file of a recording for the Rerun viewer; few modules are imported, since a process of its own may write it."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agvbench.errors import FileError
from agvbench.metrics.measured_run import MeasuredRun
from agvbench.reporting.viewer.blueprint import blueprint
from agvbench.reporting.viewer.run_entities import Place, send_events, send_floor, send_run, session_workspace


@dataclass(frozen=True)
class Recorded:
    """What a recording shows of the campaign in `directory`: runs, the colour of each condition, rows of events."""

    name: str
    directory: Path
    runs: Sequence[MeasuredRun]
    colours: Mapping[str, str]
    events: Sequence[Mapping[Hashable, Any]]


def write_recording_file(shown: Recorded, path: Path) -> None:
    """Write columns of whole runs, never row by row.

    Raises
    ------
    FileError
        If the disk refuses.
    """
    import rerun as rr

    try:
        recording = rr.RecordingStream("agvbench", recording_id=shown.name, send_properties=False)
        recording.save(path, default_blueprint=blueprint(map(Place.of, shown.runs)))
        send_floor(recording, session_workspace(shown.directory))
        for run in shown.runs:
            send_run(recording, run, shown.colours[run.condition])
        send_events(recording, shown.events)
        recording.flush()
    except RuntimeError as error:  # rerun's word for a full disk
        raise FileError(f"cannot be written ({error})") from None


def import_rerun() -> None:
    """Import what `write_recording_file` needs, before there is anything to write."""
    import rerun  # noqa: F401
