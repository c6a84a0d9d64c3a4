"""Which session runs belong to, and when it began: what a battery has had to give since it was charged."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace

from agvbench.campaign.campaign import session_starts
from agvbench.types import Run

_LONG_AGO_S = 3600.0


@dataclass(frozen=True)
class SessionBegan:
    """``name`` of a session (None where the campaign names none).

    ``started_s`` [s since the campaign began] is when its first run started, None before that.
    """

    name: str | None = None
    started_s: float | None = None

    @classmethod
    def of(cls, name: str, recorded: Collection[Run]) -> SessionBegan:
        """Return the session called `name`, or with ``""`` that of the last run `recorded`."""
        last = max(recorded, key=lambda run: run.started_s, default=None)
        chosen = name or (last.session if last else None)
        return cls(chosen, session_starts(recorded).get(chosen))

    def with_run(self, started_s: float) -> SessionBegan:
        """Return the session with a run that starts at `started_s`."""
        return replace(self, started_s=started_s) if self.started_s is None else self

    def hours(self, now_s: float) -> float:
        """Return for how long the session has gone on [h] at `now_s`."""
        return 0.0 if self.started_s is None else (now_s - self.started_s) / 3600.0


def last_end_s(recorded: Iterable[Run]) -> float:
    """Return when the last run ended [s since the campaign began], 0 where there is none."""
    return max((run.started_s + float(str(run.extra.get("duration_s", 0.0))) for run in recorded), default=0.0)


def idle_notice(recorded: Collection[Run], now_s: float, session: str) -> list[str]:
    """Return what to say where nothing was driven for long, and no new `session` was named: at most one line."""
    idle_s = now_s - last_end_s(recorded)
    is_new = bool(session) and session not in {run.session for run in recorded}
    if is_new or not recorded or idle_s < _LONG_AGO_S:
        return []
    since = f"the last run ended {idle_s / 3600.0:.1f} h ago" + (f", and {session} goes on" if session else "")
    return [f"{since}: if it was charged, re-mounted or trimmed since, stop and resume with --session and a new name"]
