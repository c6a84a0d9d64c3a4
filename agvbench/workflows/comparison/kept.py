"""What a comparison that lies in a campaign directory says, for the report of that campaign."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec

from agvbench.errors import FileError
from agvbench.text_files import read_text

JSON = "comparison.json"
_MOST_NAMED = 5


class _Check(msgspec.Struct):
    rule: str
    trajectory: str
    condition: str
    now: float | None
    allowed: float | None
    unit: str
    verdict: str


class _Kept(msgspec.Struct):
    a: str
    headline: str
    gate: Sequence[_Check] = ()


def read_comparison(directory: Path) -> tuple[str, ...]:
    """Return sentences about the comparison in a campaign directory: its headline, then the checks that failed.

    Nothing where there is none; what cannot be read is said, not raised.
    """
    path = directory / JSON
    if not path.exists():
        return ()
    try:
        kept = msgspec.json.decode(read_text(path), type=_Kept)
    except (msgspec.DecodeError, FileError) as error:
        return (f"{JSON} cannot be read: {error}.",)
    return tuple(_sentences(kept))


def _sentences(kept: _Kept) -> Iterator[str]:
    yield f"Against {kept.a}: {kept.headline}"
    failed = [check for check in kept.gate if check.verdict == "fail"]
    if kept.gate:
        named = "; ".join(map(_words, failed[:_MOST_NAMED]))
        more = f"; and {len(failed) - _MOST_NAMED} more" if len(failed) > _MOST_NAMED else ""
        yield f"Gate: {len(failed)} of {len(kept.gate)} checks failed{f': {named}{more}' if failed else ''}."


def _words(check: _Check) -> str:
    where = ", ".join(filter(None, [check.trajectory, check.condition]))
    if check.now is None or check.allowed is None:
        return f"{check.rule} ({where})"
    return f"{check.rule} ({where}: {check.now:.3g} {check.unit}, allowed {check.allowed:.3g} {check.unit})"
