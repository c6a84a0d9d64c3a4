"""Texts of messages: cut to their limit, with what is no character replaced."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
from msgspec.structs import force_setattr


def short(text: str, limit: int, *, mark: str = "") -> str:
    """Return `text` as a message can carry it: cut to `limit` characters, the last of which is then `mark`.

    >>> short("garage-calibrated-r01", 9, mark="…"), short("garage-calibrated-r01", 6)
    ('garage-c…', 'garage')
    """
    kept = text if len(text) <= limit else text[: limit - len(mark)] + mark
    return kept if kept.isascii() else kept.encode("utf-8", "replace").decode()


def cut(struct: msgspec.Struct, names: Sequence[str], limit: int, *, mark: str = "") -> None:
    """Make the fields `names` of a message `short`, where they are texts."""
    for name in names:
        text = getattr(struct, name)
        if text is not None and (len(text) > limit or not text.isascii()):
            force_setattr(struct, name, short(text, limit, mark=mark))
