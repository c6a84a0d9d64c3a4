"""Names of trajectories and conditions as arguments: text, even where they are numbers."""

from __future__ import annotations

from collections.abc import Collection

from agvbench.errors import InputError


def as_text(value: str, *, where: str) -> str:
    """Return `value`, the name of a trajectory or condition, which is text even where it is a number.

    Raises
    ------
    InputError
        If it is not text.
    """
    if not isinstance(value, str):
        # Types are checked here, because notebooks are not: trajectory=5 looks right.
        raise InputError("must be text", where=where, value=repr(value), remedy=f"write {str(value)!r}")
    return value


def as_texts(values: str | Collection[str], *, where: str) -> set[str]:
    """Return the names in `values`, or `values` as the only one.

    Raises
    ------
    InputError
        If one of them is not text.
    """
    # What is no collection is checked as a name itself, so that its error says what to write.
    several = [values] if isinstance(values, str) or not isinstance(values, Collection) else values
    return {as_text(value, where=where) for value in several}
