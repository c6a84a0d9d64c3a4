"""Sessions that differ from the others, one by one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar

Session = TypeVar("Session")


def differing_sessions(
    sessions: Mapping[str, Session],
    deviation: Callable[[Session, list[Session]], float | None],
    blocks: Callable[[Session], int],
) -> set[str]:
    """Return the names of the sessions that differ significantly from those that do not.

    The session that differs most is set apart first, because it shifts the mean of the others, and these are compared
    anew. Of two that differ from one another, the one with fewer blocks of driving is set apart.

    Parameters
    ----------
    sessions
        What is known of each session, by name.
    deviation
        Of a session from others: the difference over its standard error if it is significant, else None.
    blocks
        The number of blocks of driving of a session.
    """
    common = dict(sessions)
    while len(common) > 1:
        tested = {name: deviation(one, others(common, name)) for name, one in common.items()}
        far = {name: ratio for name, ratio in tested.items() if ratio is not None}
        if not far:
            break
        del common[max(far, key=lambda name: (far[name], -blocks(common[name])))]
    return set(sessions) - set(common)


def others(sessions: Mapping[str, Session], name: str) -> list[Session]:
    """Return what is known of all sessions but the one called `name`."""
    return [one for other, one in sessions.items() if other != name]
