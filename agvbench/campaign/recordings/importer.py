"""Import foreign recordings into a campaign, and account for every row that was left out."""

from __future__ import annotations

import datetime
import fnmatch
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa

from agvbench import __version__
from agvbench.campaign.campaign import Campaign
from agvbench.campaign.header import FILE_NAME, CampaignHeader
from agvbench.campaign.manifest import sha256
from agvbench.campaign.recordings.mapping import FileRule, Mapping, find_mapping, load_mapping
from agvbench.campaign.recordings.reading import read_recording
from agvbench.campaign.recordings.recording import Recording, recording_name
from agvbench.campaign.recordings.segmentation import Account, account_for, cut, why_nothing
from agvbench.campaign.tables.command_columns import by_role
from agvbench.campaign.tables.motion_checks import check_motion
from agvbench.campaign.tables.parts import parts_of
from agvbench.campaign.tables.timed_table import TimedTable
from agvbench.campaign.writer import CampaignWriter, check_parts, refuse_occupied
from agvbench.errors import FileError, RecordingError
from agvbench.types import NO_TARGET, RUN_OK, Commands, Floats, Frames, Run, TimeSeries

IMPORT_TABLE = "import"
_UNFINISHED = ".tmp-import"
_YEAR_2000_S = 946_684_800.0


def import_recordings(
    mapping_path: str | Path,
    files: Sequence[str | Path],
    out: str | Path,
    *,
    progress: Callable[[Iterable[Path]], Iterable[Path]] = iter,
) -> Campaign:
    """Import `files` into a new campaign directory `out`.

    The campaign has a further table ``import``: per file its rows, how many of them were not driven, not seen,
    jumped, or in pieces too short for a run, and the hashes of file and mapping.

    Parameters
    ----------
    mapping_path
        A mapping file, or the name of one that ships with agvbench (``"dart"``).
    files
        CSV files; with a mapping that has ``[pose]``, ROS bags or TUM files. Their names become the runs' ids.
    out
        A directory that does not exist yet or is empty.
    progress
        Wraps the iteration over the files, to show how far it is.

    Raises
    ------
    FileError
        If a file or the mapping cannot be used, or no run comes of them.
    CampaignError
        If `out` is not empty or the recordings contradict the campaign's schema.
    """
    mapping_path = find_mapping(mapping_path)
    mapping = load_mapping(mapping_path)
    paths = _distinct(files)
    refuse_occupied(Path(out), "choose another directory")
    runs: list[Run] = []
    accounts: list[Account] = []
    clock = _Clock(absolute=mapping.is_absolute)
    for path in progress(paths):
        recording = read_recording(path, mapping)
        pieces = cut(recording, mapping.runs)
        begin_s = clock.begin(recording)
        rule = _rule_for(path, mapping)
        runs += [_run(recording, rows, number, begin_s, mapping, rule) for number, rows in enumerate(pieces, start=1)]
        accounts.append(account_for(recording, pieces))
    if not runs:
        raise FileError(why_nothing(accounts), where=", ".join(path.name for path in paths), remedy=_REMEDY_NOTHING)
    header = mapping.header(mapping_path)
    _check(runs, header, mapping_path)
    return _write(Path(out), header, clock.from_zero(runs), accounts, mapping_path)


_REMEDY_NOTHING = "check the mapping's columns.driven, columns.tracked, [gate] and [runs]"


class _Clock:
    """Places recordings in the campaign's time: as they are, or one after another."""

    def __init__(self, *, absolute: bool) -> None:
        self._absolute = absolute
        self._next_s = 0.0

    def begin(self, recording: Recording) -> float:
        """Return what to add to the recording's time."""
        if self._absolute or not len(recording):
            return recording.origin_s
        offset = self._next_s - float(recording.t_s[0])
        self._next_s += float(recording.t_s[-1] - recording.t_s[0])
        return offset

    @staticmethod
    def from_zero(runs: list[Run]) -> list[Run]:
        """Return the runs in order of time, the first beginning at 0."""
        from dataclasses import replace

        first_s = min(run.started_s for run in runs)
        ordered = sorted(runs, key=lambda run: run.started_s)
        return [replace(run, started_s=round(run.started_s - first_s, 6)) for run in ordered]


def _distinct(files: Sequence[str | Path]) -> list[Path]:
    paths = [Path(file) for file in files]
    if not paths:
        raise FileError("no recordings were given", remedy="name one file or more")
    names = [recording_name(path) for path in paths]
    for path, name in zip(paths, names, strict=True):
        if names.count(name) > 1:
            raise FileError("two recordings have one name", where=path, value=name, remedy="rename one")
    return paths


def _check(runs: list[Run], header: CampaignHeader, mapping_path: Path) -> None:
    """Check the runs before anything is written."""
    parts = [parts_of(run, header) for run in runs]
    for run, tables in zip(runs, parts, strict=True):
        check_parts(tables, Path(str(run.extra["source"])), header)
    whole = {name: pa.concat_tables([tables[name] for tables in parts]) for name in ("runs", "commands", "poses")}
    ids = [run.run_id for run in runs]
    whole["commands"] = by_role(whole["commands"], header)
    commands, poses = (TimedTable(mapping_path, whole[name], ids, in_parts=True) for name in ("commands", "poses"))
    check_motion(header, whole["runs"], commands, poses)


def _rule_for(path: Path, mapping: Mapping) -> FileRule:
    rules = (rule for rule in mapping.files if fnmatch.fnmatch(path.name, rule.match))
    return next(rules, FileRule(match="*"))


def _run(recording: Recording, rows: slice, number: int, begin_s: float, mapping: Mapping, rule: FileRule) -> Run:
    defaults = mapping.runs
    start_s = float(recording.t_s[rows.start])
    extra: dict[str, object] = {"source": recording.path.name, "source_row": rows.start + 1}
    if defaults.command_hold_s is not None:
        extra["command_hold_s"] = defaults.command_hold_s
    return Run(
        run_id=f"{recording.name}-{number:03d}",
        experiment=rule.experiment or defaults.experiment,
        trajectory=rule.trajectory or defaults.trajectory,
        condition=rule.condition or defaults.condition,
        repeat=0,  # pieces of one recording repeat nothing
        target=NO_TARGET,
        started_s=begin_s + start_s,
        status=RUN_OK,
        firmware=rule.firmware or defaults.firmware,
        commands=_commands(recording, rows, start_s),
        frames=_frames(recording, rows, start_s),
        session=rule.session or _session(recording, start_s, mapping),
        extra=extra,
        logged=_logged(recording, rows, start_s),
    )


def _session(recording: Recording, start_s: float, mapping: Mapping) -> str:
    if mapping.runs.session == "file":
        return recording.name
    if mapping.runs.session == "campaign":
        return mapping.name
    if recording.origin_s + start_s < _YEAR_2000_S:
        remedy = 'set runs.session to "file" or "campaign"'
        raise FileError("time does not count from 1970, so its day is unknown", where=recording.path, remedy=remedy)
    return datetime.datetime.fromtimestamp(recording.origin_s + start_s, datetime.UTC).date().isoformat()


def _commands(recording: Recording, rows: slice, start_s: float) -> Commands:
    """Return the commands while these rows were recorded, one row for each change."""
    commands = recording.commands
    first = int(np.searchsorted(commands.t_s, start_s, side="right")) - 1  # given before, and held
    last = int(np.searchsorted(commands.t_s, recording.t_s[rows.stop - 1], side="right"))
    values = np.column_stack([commands.drive, commands.front, commands.rear])[first:last]
    changed = np.flatnonzero(np.r_[True, np.any(np.diff(values, axis=0) != 0.0, axis=1)])
    return Commands(np.maximum(commands.t_s[first:last][changed] - start_s, 0.0), *values[changed].T)


def _logged(recording: Recording, rows: slice, start_s: float) -> dict[str, TimeSeries]:
    """Return the further quantities at the times of these rows, each held from when it was logged."""
    t_s = recording.t_s[rows]
    return {name: TimeSeries(t_s - start_s, series.held_at(t_s)) for name, series in recording.logged.items()}


def _frames(recording: Recording, rows: slice, start_s: float) -> Frames:
    poses, tracked = recording.poses, (recording.seen & ~recording.jumped)[rows]

    def blank(values: Floats) -> Floats:
        return np.where(tracked, values[rows], np.nan)

    return Frames(
        t_s=recording.t_s[rows] - start_s,
        x_m=blank(poses.x_m),
        y_m=blank(poses.y_m),
        heading_rad=blank(poses.heading_rad),
        tracked=tracked,
        frame=poses.frame[rows],
        mean_error_m=poses.mean_error_m[rows],
        received_s=np.full(len(tracked), np.nan),
    )


def _write(out: Path, header: CampaignHeader, runs: list[Run], accounts: list[Account], mapping_path: Path) -> Campaign:
    """Write the campaign whole or not at all: some of its runs would pass for all of them."""
    import shutil

    unfinished, is_new = out / _UNFINISHED, not out.exists()
    try:
        _fill(unfinished, header, runs, accounts, mapping_path)
        # Without its head, which comes last, it is no campaign.
        for path in sorted(unfinished.iterdir(), key=lambda path: path.name == FILE_NAME):
            path.rename(out / path.name)
        unfinished.rmdir()
    except BaseException as error:
        shutil.rmtree(out if is_new else unfinished, ignore_errors=True)
        if isinstance(error, RecordingError):
            remedy = "free some space, or choose another directory"
            raise RecordingError(error.what, where=out, remedy=remedy) from None
        raise
    return Campaign.open(out)


def _fill(
    directory: Path, header: CampaignHeader, runs: list[Run], accounts: list[Account], mapping_path: Path
) -> None:
    import pandas as pd

    writer = CampaignWriter.create(directory, header)
    for run in runs:
        writer.append(run)
    table = pd.DataFrame(accounts)
    table["mapping"] = mapping_path.name
    table["mappingsha256"] = sha256(mapping_path)
    table["agvbench"] = __version__
    writer.write_table(IMPORT_TABLE, table)
    Campaign.open(directory).check()
