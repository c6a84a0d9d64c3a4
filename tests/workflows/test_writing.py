"""Files that an option names: replaced by whole ones, or left as they were."""

from __future__ import annotations

import errno
import os
import resource
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from agvbench import thesis
from agvbench.campaign.manifest import Manifest, record
from agvbench.errors import FileError
from agvbench.statistics import Comparison
from agvbench.workflows.comparison.decision import write_json
from agvbench.workflows.init import make_lab
from agvbench.workflows.output_files import write_file

NOTHING_COMPARED = Comparison("A", "B", (), (), (), (), alpha=0.01, tests=0)


def run_out_of_space(path: Path) -> None:
    path.write_text("half of it")
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("before", ["the calibration of last week", None])
def test_a_full_disk_leaves_the_file_as_it_was(before: str | None, tmp_path: Path) -> None:
    path = tmp_path / "calibrated.toml"
    if before is not None:
        path.write_text(before)
    with pytest.raises(FileError, match=r"calibrated.toml: cannot be written: No space left on device; give --out"):
        write_file("--out", path, run_out_of_space)
    assert [file.read_text() for file in tmp_path.iterdir()] == ([] if before is None else [before])


@pytest.fixture
def full(tmp_path: Path) -> Iterator[None]:
    """A disk on which no file can be longer than 300 bytes."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (300, limits[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)


@pytest.mark.parametrize("existing", [".", "empty"])
@pytest.mark.usefixtures("full")
def test_a_lab_folder_is_made_as_a_whole_or_not_at_all(existing: str, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(FileError, match=r"lab: cannot be written \(File too large\); choose another folder"):
        make_lab(tmp_path / existing / "new" / "lab")
    with pytest.raises(FileError, match=r"cannot be written"):
        make_lab(tmp_path / "empty")
    assert list(tmp_path.rglob("*")) == [tmp_path / "empty"]


def test_a_file_of_a_campaign_is_replaced_with_its_hash(tmp_path: Path) -> None:
    record(tmp_path, {"vehicle.toml": b"recorded"})
    write_file("--out", tmp_path / "vehicle.toml", lambda path: path.write_text("calibrated anew"))
    Manifest(tmp_path).check_beside()


def test_a_link_is_followed_and_a_pipe_is_written_to(tmp_path: Path) -> None:
    link, target, pipe = tmp_path / "link.toml", tmp_path / "target.toml", tmp_path / "pipe"
    link.symlink_to(target)
    write_file("--out", link, lambda path: path.write_text("whole"))
    assert link.is_symlink()
    assert target.read_text() == "whole"
    os.mkfifo(pipe)
    read: list[str] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()))
    reader.start()
    write_file("--out", pipe, lambda path: path.write_text("through"))
    reader.join()
    assert read == ["through"]
    assert pipe.is_fifo()


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("comparison.json", lambda path: write_json(NOTHING_COMPARED, path)),
        ("thesis.json", lambda path: thesis.write_json([], path)),
        ("thesis.md", lambda path: thesis.write_tables([], path.parent)),
    ],
)
def test_results_for_programs_replace_a_file_as_a_whole(
    name: str, write: Callable[[Path], object], tmp_path: Path
) -> None:
    path, before = tmp_path / name, tmp_path / "before"
    path.write_text("before")
    before.hardlink_to(path)
    write(path)
    assert before.read_text() == "before"
    assert path.read_text().endswith("\n")
