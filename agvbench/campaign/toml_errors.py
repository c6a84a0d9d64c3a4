"""Validation errors of TOML files: msgspec's findings in the words of the file."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any, get_args

import msgspec


def validation_message(error: msgspec.ValidationError, tables: Iterable[Any]) -> str:
    """Return e.g. ``"runs: unknown key gaps_s (did you mean gap_s?)"``.

    Parameters
    ----------
    error
        What `msgspec.convert` raised.
    tables
        The structs that the file is made of: their keys are what may have been meant, their literals what may stand.
    """
    what, _, place = str(error).replace("`", "").partition(" - at $.")
    what = what.removeprefix("Object contains ").replace("unknown field", "unknown key")
    what = what.replace("Object missing required field", "lacks key")
    fields = {field.name: field.type for table in tables for field in msgspec.structs.fields(table)}
    if what.startswith("unknown key"):
        if close := difflib.get_close_matches(what.rsplit(" ", 1)[-1], fields, 1):
            what += f" (did you mean {close[0]}?)"
    elif what.startswith("Invalid enum value"):
        choices = get_args(fields.get(place.rpartition(".")[2]))
        what += f" (one of {', '.join(map(str, choices))})" if choices else ""
    what = what[:1].lower() + what[1:]
    return f"{place}: {what}" if place else what
