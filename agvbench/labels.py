"""Labels of a campaign: what a lab notes of the circumstances, such as ``tyres = "new"``. Imports nothing heavy."""

from __future__ import annotations

import re
from collections.abc import Mapping

from agvbench.errors import CampaignError, FileError, FlagError

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,39}")
_MOST, _LONGEST = 32, 80
_SPELLING = "a letter, then letters, digits, _ and -, 40 at most"


def checked_labels(
    table: Mapping[str, object], *, where: str, error: type[CampaignError | FileError | FlagError]
) -> dict[str, str]:
    """Return labels as texts by name; numbers become texts.

    Raises
    ------
    `error`
        If there are too many, or a name or value cannot be used.

    Examples
    --------
    >>> checked_labels({"tyres": "new", "carpet": 2}, where="labels", error=FileError)
    {'tyres': 'new', 'carpet': '2'}
    """
    if len(table) > _MOST:
        raise error("has too many labels", where=where, value=len(table), limit=_MOST, remedy="leave some out")
    for name, value in table.items():
        if not _NAME.fullmatch(name):
            raise error("label has no such name", where=where, value=repr(name)[:_LONGEST], limit=_SPELLING)
        if isinstance(value, bool) or not isinstance(value, (str, int, float)) or not _is_line(str(value)):
            limit = f"one line of 1 to {_LONGEST} characters, or a number"
            raise error("label cannot be used", where=f"{where}.{name}", value=repr(value)[:_LONGEST], limit=limit)
    return {name: str(value) for name, value in table.items()}


def labels_given(text: str) -> dict[str, str]:
    """Return the labels that the option ``--label`` gives: NAME=VALUE, several with commas.

    Raises
    ------
    FlagError
        If it gives none, or one that cannot be used.

    Examples
    --------
    >>> labels_given("tyres=new,carpet=2")
    {'tyres': 'new', 'carpet': '2'}
    """
    pairs = [part.partition("=") for part in text.split(",")] if text else []
    for name, equals, _ in pairs:
        if not equals:
            raise FlagError("is no label", where="--label", value=repr(name), remedy="give NAME=VALUE")
    return checked_labels({n.strip(): v.strip() for n, _, v in pairs}, where="--label", error=FlagError)


def _is_line(text: str) -> bool:
    return 0 < len(text) <= _LONGEST and text.isprintable() and bool(text.strip())
