"""Which session runs belong to, and when it began: what a battery has had to give since it was charged."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from agvbench.campaign.sessions import session_starts
from agvbench.types import Run

_LONG_AGO_S = 3600.0


@dataclass(frozen=True)
class SessionBegan:
    """``name`` of a session (None where the campaign names none), and ``started_s`` [s since the campaign began]."""

    name: str | None = None
    started_s: float = 0.0

    @classmethod
    def of(cls, name: str, recorded: Collection[Run], now_s: float) -> SessionBegan:
        """Return the session called `name`, or with ``""`` that of the last run `recorded`; a new one begins now."""
        last = max(recorded, key=lambda run: run.started_s, default=None)
        chosen = name or (last.session if last else None)
        if chosen is None:
            return cls()
        return cls(chosen, session_starts(recorded).get(chosen, now_s))


def last_end_s(recorded: Iterable[Run]) -> float:
    """Return when the last run ended [s since the campaign began], 0 where there is none."""
    return max((run.started_s + float(str(run.extra.get("duration_s", 0.0))) for run in recorded), default=0.0)


def idle_notice(recorded: Collection[Run], now_s: float, session: str) -> list[str]:
    """Return what to say where nothing was driven for long, and no new session was named: at most one line."""
    idle_s = now_s - last_end_s(recorded)
    if session or not recorded or idle_s < _LONG_AGO_S:
        return []
    since = f"the last run ended {idle_s / 3600.0:.1f} h ago"
    return [f"{since}: if it was charged, re-mounted or trimmed since, stop and resume with --session and a new name"]
