"""Faults of the disk that a campaign is recorded on: the run is driven to its end, and cannot be kept."""

import resource
import shutil
from pathlib import Path

from fault_bench import Campaign
from fault_record import Fault, Then

_FEW_BYTES = 600
_LIMIT = resource.getrlimit(resource.RLIMIT_FSIZE)


def _fill(_: Path) -> None:
    # No file may grow any more: the kernel refuses writes as it does on a disk that is full.
    resource.setrlimit(resource.RLIMIT_FSIZE, (_FEW_BYTES, _LIMIT[1]))


def _free(_: Path) -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, _LIMIT)


def _aside(path: Path) -> Path:
    return path.with_name("aside")


def _take_away(path: Path) -> None:
    shutil.move(path, _aside(path))


def _bring_back(path: Path) -> None:
    shutil.move(_aside(path), path)


def _block(path: Path) -> None:
    (path / "poses.parquet").rename(_aside(path))
    (path / "poses.parquet").write_bytes(b"")


def _unblock(path: Path) -> None:
    (path / "poses.parquet").unlink()
    _aside(path).rename(path / "poses.parquet")


FAULTS = (
    Fault(
        "disk full",
        "recording",
        "the disk is full",
        Then.STOPS,
        Campaign(do=_fill, undo=_free),
        "cannot be written (File too large); free some space",
        instead="already at rest",
    ),
    Fault(
        "folder gone",
        "recording",
        "the folder of the campaign is moved",
        Then.STOPS,
        Campaign(do=_take_away, undo=_bring_back),
        "cannot be written (No such file or directory); bring the folder back",
        instead="already at rest",
    ),
    Fault(
        "folder unwritable",
        "recording",
        "the folder of a table is not writable",
        Then.STOPS,
        Campaign(do=_block, undo=_unblock),
        "cannot be written (Not a directory); bring the folder back",
        instead="already at rest",
    ),
)
