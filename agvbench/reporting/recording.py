"""A recording for the Rerun viewer: what it shows of a campaign's runs that count, and its faults."""

from __future__ import annotations

from pathlib import Path

from agvbench.plot.style import colour, condition_numbers
from agvbench.reporting.content import plain
from agvbench.reporting.viewer.blueprint import blueprint
from agvbench.reporting.viewer.run_entities import Place, send_events, send_floor, send_run, session_workspace
from agvbench.statistics.end_poses import in_order
from agvbench.workflows.report import ReportData


def write_recording(data: ReportData, path: Path) -> None:
    """Write `data` as a recording: columns of whole runs, never row by row.

    Under ``/runs/TRAJECTORY/CONDITION/RUN``: ``path``, ``plan`` (lines) and ``target`` (an arrow), always there;
    ``vehicle`` (an arrow that moves on the timeline ``run_time``, 0 at the first command), ``commands`` (each of the
    three, held until the next) and ``residual`` (along the planned path). Poses are thinned to 60 Hz. ``/floor`` is the
    workspace, ``/faults`` what adapters reported. The viewer opens with all runs on one floor, and with a tab for each
    trajectory, in it for each condition, in it for each run.
    """
    import rerun as rr

    counted = [run for run in data.runs if run.is_ok]
    recording = rr.RecordingStream("agvbench", recording_id=plain(data.header.name), send_properties=False)
    recording.save(path, default_blueprint=blueprint(map(Place.of, counted)))
    numbers = condition_numbers(in_order(run.condition for run in data.runs))
    send_floor(recording, session_workspace(data.path))
    for run in counted:
        send_run(recording, run, colour(numbers[run.condition]), data.planned)
    send_events(recording, data.events.to_dict("records"))
    recording.flush()
