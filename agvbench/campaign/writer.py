"""Record a campaign run by run, so that whatever interrupts it leaves every finished run whole."""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa

from agvbench.campaign.atomic_files import TEMPORARY_PREFIX, is_temporary
from agvbench.campaign.header import FILE_NAME, CampaignHeader
from agvbench.campaign.lock import LOCK_FILE
from agvbench.campaign.manifest import MANIFEST_FILE, PLANNED_TABLE, Manifest, record
from agvbench.campaign.tables.command_columns import by_role
from agvbench.campaign.tables.consistency import check_commands, check_poses, check_runs
from agvbench.campaign.tables.parquet import to_parquet
from agvbench.campaign.tables.parts import part_name, parts_of, run_id_of
from agvbench.campaign.tables.schema import TABLES
from agvbench.campaign.tables.source import parts
from agvbench.campaign.tables.timed_table import TimedTable, blank_untracked
from agvbench.errors import CampaignError, RecordingError
from agvbench.types import Run

if TYPE_CHECKING:
    import pandas as pd


_HEADS = (FILE_NAME, "bench.toml", "vehicle.toml")
_FURTHER_TABLES = (PLANNED_TABLE, "inputs", "provenance", "events", "calibration", "import")
_BESIDE = frozenset((*_HEADS, *(f"{name}.parquet" for name in (*TABLES, *_FURTHER_TABLES))))
_FULL = frozenset((errno.ENOSPC, errno.EDQUOT, errno.EFBIG))


class CampaignWriter:
    """Appends runs to a campaign directory; get one with `create` or `resume`.

    Each run is a part in each of three directories. The part in ``runs.parquet`` is renamed into place last:
    a run exists if, and only if, that part exists.

    Attributes
    ----------
    recovered
        What `resume` removed: parts of unfinished runs and half-written files, as paths inside the campaign.
    """

    def __init__(self, path: Path, header: CampaignHeader, *, durable: bool = True) -> None:
        self.path = path
        self.header = header
        self.recovered: list[str] = []
        self._durable = durable
        self._finished: dict[str, None] = {}

    @classmethod
    def create(cls, path: str | Path, header: CampaignHeader, *, durable: bool = True) -> CampaignWriter:
        """Begin a campaign in `path`, which must not exist yet or be empty.

        With `durable` (the default) each part is forced to disk before it counts, so that finished runs survive a
        power cut as well as a killed process.

        Raises
        ------
        CampaignError
            If `path` holds something already, or cannot be read or written.
        """
        path = Path(path)
        try:
            refuse_occupied(path, "resume it, or choose another directory")
            path.mkdir(parents=True, exist_ok=True)
            header.save(path / FILE_NAME)  # first: what has a head can be resumed
            for name in TABLES:
                (path / f"{name}.parquet").mkdir()
        except OSError as error:
            raise CampaignError(
                f"cannot be written ({error.strerror})", where=path, remedy="choose another directory"
            ) from None
        return cls(path, header, durable=durable)

    @classmethod
    def resume(cls, path: str | Path, header: CampaignHeader, *, durable: bool = True) -> CampaignWriter:
        """Go on with the campaign in `path`; what an interruption left of unfinished runs is removed.

        Raises
        ------
        CampaignError
            If there is no campaign, it was begun with another header, its tables are single files, or a recorded file
            is missing or has changed.
        """
        path = Path(path)
        manifest = Manifest(path)
        manifest.check_beside()
        manifest.require_files()
        stored = CampaignHeader.load(path / FILE_NAME)
        if stored.channels != header.channels:
            raise CampaignError(
                "was begun with other command channels", where=path, value=f"{header.channels}",
                limit=f"{stored.channels}", remedy="resume with the same vehicle, or begin a new campaign",
            )  # fmt: skip
        for field in fields(header):
            old, new = getattr(stored, field.name), getattr(header, field.name)
            if old != new:
                remedy = "resume with the same vehicle and settings, or begin a new campaign"
                raise CampaignError(
                    f"was begun with another {field.name} ({old!r})", where=path, value=f"now {new!r}", remedy=remedy
                )
        for name in TABLES:
            if not (directory := path / f"{name}.parquet").is_dir():
                if directory.exists() or (path / f"{name}.csv").exists():
                    remedy = "only a directory of parts can be appended to"
                    raise CampaignError(f"has its table {name} in one file", where=path, remedy=remedy)
                directory.mkdir()
        writer = cls(path, header, durable=durable)
        writer._recover()
        return writer

    def _recover(self) -> None:
        self._finished = {run_id_of(part): None for part in parts(self.path / "runs.parquet")}
        manifest = Manifest(self.path)
        for name in TABLES:
            orphans = (part for part in parts(self.path / f"{name}.parquet") if run_id_of(part) not in self._finished)
            self._remove(part for part in orphans if not manifest.is_in_place(part))
        for directory in (self.path, *(self.path / f"{name}.parquet" for name in TABLES)):
            self._remove(file for file in sorted(directory.iterdir()) if is_temporary(file) and file.is_file())
        with self._recording():
            manifest.renew(self._files(manifest), durable=self._durable)

    def _files(self, manifest: Manifest) -> list[Path]:
        """Return the files that belong to the campaign: what is listed already, heads, further tables and parts."""
        names = sorted(_BESIDE.union(manifest.names_beside))
        beside = (file for name in names if (file := self.path / name).is_file())
        return [*beside, *(part for name in TABLES for part in parts(self.path / f"{name}.parquet"))]

    def _remove(self, files: Iterable[Path]) -> None:
        for file in files:
            with self._recording():
                file.unlink()
            self.recovered.append(str(file.relative_to(self.path)))

    @contextmanager
    def _recording(self) -> Iterator[None]:
        """Say in one line what the disk refuses."""
        try:
            yield
        except OSError as error:
            full = error.errno in _FULL
            raise RecordingError(
                f"cannot be written ({error.strerror})", where=self.path,
                remedy=f"{'free some space' if full else 'bring the folder back'}, then go on with --resume",
            ) from None  # fmt: skip

    @property
    def finished_ids(self) -> list[str]:
        """The ids of the runs that are recorded, of whatever status."""
        return list(self._finished)

    def append(self, run: Run) -> None:
        """Record one run: all of it or, if interrupted, nothing of it.

        Raises
        ------
        CampaignError
            If there is a run of that id already, its id cannot name a file, or it contradicts the schema: nothing is
            written then.
        RecordingError
            If the disk refuses.
        """
        if run.run_id in self._finished:
            raise CampaignError(
                "two runs have one id", where=self.path, value=run.run_id, remedy="give the run its own id"
            )
        name = part_name(run.run_id)
        tables = parts_of(run, self.header)
        check_parts(tables, self.path, self.header)
        files = {f"{table}.parquet/{name}": to_parquet(part) for table, part in tables.items()}
        with self._recording():
            record(self.path, files, durable=self._durable)
        self._finished[run.run_id] = None

    def write_table(self, name: str, table: pd.DataFrame) -> None:
        """Write (or replace) a further table, such as ``events`` or ``provenance``, beside the three.

        Raises
        ------
        CampaignError
            If `name` is one of the three.
        RecordingError
            If the disk refuses.
        """
        if name in TABLES:
            raise CampaignError(
                "is written run by run", where=self.path, value=name, remedy="choose another table name"
            )
        arrow = pa.Table.from_pandas(table, preserve_index=False).replace_schema_metadata(None)
        with self._recording():
            record(self.path, {f"{name}.parquet": to_parquet(arrow)}, durable=self._durable)

    def write_beside(self, name: str, write: Callable[[Path], object]) -> None:
        """Have `write` write a further file, such as ``vehicle.toml``: it is there as a whole or not at all.

        Raises
        ------
        RecordingError
            If the disk refuses.
        """
        with self._recording():
            temporary = self.path / f"{TEMPORARY_PREFIX}{name}"
            write(temporary)
            record(self.path, {name: temporary.read_bytes()}, durable=self._durable)


def check_parts(tables: Mapping[str, pa.Table], where: Path, header: CampaignHeader) -> None:
    """Raise `CampaignError`, at `where`, for a run that would make a whole campaign unreadable later."""
    run_ids, status = (tables["runs"][name].to_pylist() for name in ("run_id", "status"))
    check_runs(tables["runs"], where)
    commands = TimedTable(where, by_role(tables["commands"], header), run_ids, in_parts=True)
    poses = TimedTable(where, blank_untracked(tables["poses"]), run_ids, in_parts=True)
    check_commands(commands, status, header)
    check_poses(poses, status, commands.last("t_s"))


_LEFT_OVER = frozenset((MANIFEST_FILE, LOCK_FILE))
"""What a session leaves in a directory that ended before its campaign had a head."""


def refuse_occupied(path: Path, remedy: str) -> None:
    """Raise `CampaignError` if a path is not a directory or has something in it."""
    try:
        if path.exists() and not path.is_dir():
            raise CampaignError("is not a directory", where=path, remedy="choose another directory")
        if path.exists() and any(file.name not in _LEFT_OVER and not is_temporary(file) for file in path.iterdir()):
            raise CampaignError("exists already and is not empty", where=path, remedy=remedy)
    except OSError as error:
        raise CampaignError(
            f"cannot be read ({error.strerror})", where=path, remedy="choose another directory"
        ) from None
