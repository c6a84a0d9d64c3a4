"""SHA-256 hashes of a campaign's finished files, in the format of ``sha256sum``: damage is found when they are read.

A hash is appended before its file is renamed into place, and a comment after it. Whatever interrupts them, a file has
its hash; a hash that no comment follows may be without its file, and any may stand beside that of the file's earlier
content. Files that are not listed are read without this check: campaigns of other programs have no list.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from agvbench.campaign.atomic_files import write_all, write_atomically
from agvbench.errors import CampaignError
from agvbench.text_files import require_regular

PLANNED_TABLE = "planned"
MANIFEST_FILE = "SHA256SUMS"
_LINE = re.compile(r"([0-9a-f]{64}) [ *](.+)")
_IN_PLACE = re.compile(r"# files above that are in place: ([1-9]\d{0,8})")
_CUT_OFF = re.compile(r"[0-9a-f]{0,64}[ *]{0,2}\0*")  # file systems may fill with zeros what a power cut took
_SHOWN = 3


def record(directory: Path, files: Mapping[str, bytes | memoryview], *, durable: bool = True) -> None:
    """Write `files` (content by path inside the campaign), each whole or not at all, and list their hashes before."""
    hashes = {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
    _append(directory / MANIFEST_FILE, _lines(hashes), durable=durable)
    for name, data in files.items():
        write_atomically(directory / name, data, durable=durable)
    with suppress(OSError):  # the files are recorded, with or without it
        _append(directory / MANIFEST_FILE, _in_place(len(files)), durable=False)


def list_file(directory: Path, name: str, file: Path) -> None:
    """List the hash of `file`, which is about to be renamed to `name`, if the campaign in `directory` has a list."""
    if (directory / MANIFEST_FILE).is_file():
        _append(directory / MANIFEST_FILE, _lines({name: sha256(file)}), durable=True)


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def sha256_of_all(files: Sequence[Path]) -> str:
    """Return the SHA-256 of a file; of several files that of the list of theirs, as ``sha256sum`` prints it."""
    if len(files) == 1:
        return sha256(files[0])
    return hashlib.sha256(_lines({file.name: sha256(file) for file in files})).hexdigest()


class Manifest:
    """The hashes listed for the campaign in `directory`; none where it has no list.

    Raises
    ------
    CampaignError
        If the list is damaged, or missing although agvbench recorded the campaign.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._hashes: dict[str, set[str]] = {}
        self._in_place: set[str] = set()
        self._read()

    def _read(self) -> None:
        """Read hashes by path, and which files were in place; a line that an interruption cut off is left out."""
        self._hashes, self._in_place = {}, set()
        pending: list[str] = []
        for number, line in enumerate(self._text().split("\n"), start=1):
            if match := _LINE.fullmatch(line):
                self._hashes.setdefault(match[2], set()).add(match[1])
                pending.append(match[2])
            elif match := _IN_PLACE.fullmatch(line):
                self._in_place.update(pending[-int(match[1]) :])
                pending.clear()
            elif not (line.startswith("#") or _CUT_OFF.fullmatch(line)):
                raise self._damaged(f"line {number} is not a SHA-256 and a file name")
        if not self._hashes and (self._directory / f"{PLANNED_TABLE}.parquet").exists():
            raise self._damaged("is missing or empty, although agvbench recorded this campaign")

    def _text(self) -> str:
        path = self._directory / MANIFEST_FILE
        try:
            require_regular(path)
            return path.read_text(encoding="utf-8", errors="replace")
        except (FileNotFoundError, NotADirectoryError):
            return ""
        except OSError as error:
            raise self._damaged(f"cannot be read ({error.strerror})") from None

    def _damaged(self, what: str) -> CampaignError:
        remedy = "restore it from a copy, or list the files again (docs/reference/campaign-directory.md#hashes)"
        return CampaignError(what, where=self._directory / MANIFEST_FILE, remedy=remedy)

    def require_files(self) -> None:
        """Raise `CampaignError` if a file that was in place is not there."""
        missing = [name for name in self._hashes if name in self._in_place and not (self._directory / name).exists()]
        if missing:
            more = f" and {len(missing) - _SHOWN} more" if len(missing) > _SHOWN else ""
            raise CampaignError(
                f"lacks files that {MANIFEST_FILE} lists", where=self._directory,
                value=", ".join(missing[:_SHOWN]) + more,
                remedy="restore them from a copy, or delete their lines; of a run delete all parts and their lines, "
                "then drive it again with --resume",
            )  # fmt: skip

    @property
    def names_beside(self) -> list[str]:
        """The listed files that lie beside the tables' parts, such as ``vehicle.toml``."""
        return [name for name in self._hashes if "/" not in name]

    def is_in_place(self, file: Path) -> bool:
        """Whether the list says that `file` was in place."""
        return file.relative_to(self._directory).as_posix() in self._in_place

    def check(self, file: Path) -> None:
        """Raise `CampaignError` if `file` is listed and its content is not what was recorded."""
        name = file.relative_to(self._directory).as_posix()
        if name not in self._hashes or not file.is_file():
            return
        found = _hash(file)
        if found not in self._hashes[name]:
            self._read()  # a session that is recording may have replaced it since
        if found not in self._hashes.get(name, {found}):
            raise CampaignError(
                f"has changed since it was recorded (its SHA-256 is not in {MANIFEST_FILE})", where=file,
                remedy=f"restore it from a copy; to keep an intended change, delete its line in {MANIFEST_FILE}",
            )  # fmt: skip

    def check_beside(self) -> None:
        """`check` every listed file that lies beside the tables' parts, such as ``vehicle.toml``."""
        for name in self.names_beside:
            self.check(self._directory / name)

    def renew(self, files: Iterable[Path], *, durable: bool = True) -> None:
        """`check` `files` and write the list again: one line for each of them, listed before or not."""
        present = {file.relative_to(self._directory).as_posix(): file for file in files}
        for file in present.values():
            self.check(file)
        ordered = [name for name in self._hashes if name in present]
        ordered += [name for name in present if name not in self._hashes]
        lines = _lines({name: _hash(present[name]) for name in ordered}) + _in_place(len(ordered))
        write_atomically(self._directory / MANIFEST_FILE, lines, durable=durable)


def check_file(directory: Path, name: str) -> None:
    """`Manifest.check` one file of a campaign; the list is not parsed where it has the file's hash."""
    path = directory / MANIFEST_FILE
    try:
        require_regular(path)
        if _lines({name: sha256(directory / name)}) in path.read_bytes():
            return
    except OSError:  # no list, or none that can be read: said below
        pass
    Manifest(directory).check(directory / name)


def _hash(file: Path) -> str:
    try:
        return sha256(file)
    except OSError as error:
        raise CampaignError(f"cannot be read ({error.strerror})", where=file, remedy="check permissions") from None


def _lines(hashes: Mapping[str, str]) -> bytes:
    return "".join(f"{digest}  {name}\n" for name, digest in hashes.items()).encode()


def _in_place(count: int) -> bytes:
    return f"# files above that are in place: {count}\n".encode()


def _append(path: Path, lines: bytes, *, durable: bool) -> None:
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        size = os.fstat(descriptor).st_size
        cut_off = size > 0 and os.pread(descriptor, 1, size - 1) != b"\n"
        write_all(descriptor, b"\n" * cut_off + lines, durable=durable)
    finally:
        os.close(descriptor)
