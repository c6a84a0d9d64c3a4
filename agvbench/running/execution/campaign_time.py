"""Campaign time: when a run started, counted from the campaign's beginning, and when its session began."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, replace
from typing import Protocol

from agvbench.campaign.campaign import session_starts
from agvbench.types import Run

# In simulation, what driving back to the start and settling there would take between two runs.
TURNAROUND_S = 15.0


class CampaignTime(Protocol):
    """Gives the times at which runs start and end [s since the campaign began]."""

    def now_s(self) -> float:
        """Return the time since the campaign began [s]."""
        ...

    def has_run(self, started_s: float, duration_s: float) -> None:
        """Take note of a run that was driven, now or before an interruption."""

    def has_placed(self, duration_s: float) -> None:
        """Take note of a vehicle that drove itself to its start."""


class SimulatedCampaignTime:
    """Runs one after another with a fixed turnaround: the same campaign whether or not it was interrupted.

    A vehicle that drives itself to its start needs no turnaround: it takes the time it takes.
    """

    def __init__(self, turnaround_s: float = TURNAROUND_S) -> None:
        self._now_s, self._turnaround_s = 0.0, turnaround_s

    def now_s(self) -> float:
        """Return the simulated time since the campaign began [s]."""
        return self._now_s

    def has_run(self, started_s: float, duration_s: float) -> None:
        """Advance to when the next run can start."""
        self._now_s = started_s + duration_s + self._turnaround_s

    def has_placed(self, duration_s: float) -> None:
        """Advance by what it took."""
        self._now_s += duration_s


class WallCampaignTime:
    """Real time since `began_unix_s`, which never goes back.

    The wall clock is asked once, when the session opens: it may be set while runs are driven. If it was set back since
    the last session, time goes on at `last_s` [s], when that session's last run ended.
    """

    def __init__(
        self,
        began_unix_s: float,
        last_s: float = 0.0,
        *,
        wall: Callable[[], float] = time.time,
        steady: Callable[[], float] = time.monotonic,
    ) -> None:
        self._steady, self._opened_s = steady, steady()
        self._before_s = max(wall() - began_unix_s, last_s)

    def now_s(self) -> float:
        """Return the time since the campaign began [s]."""
        return self._before_s + self._steady() - self._opened_s

    def has_run(self, started_s: float, duration_s: float) -> None:
        """Do nothing: wall time passes by itself."""

    def has_placed(self, duration_s: float) -> None:
        """Nor this."""


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
