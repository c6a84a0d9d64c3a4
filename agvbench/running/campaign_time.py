"""The campaign's clock: when a run started, counted from the beginning of the campaign."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

# In simulation, what driving back to the start and settling there would take between two runs.
TURNAROUND_S = 15.0


class CampaignTime(Protocol):
    """Tells when runs start and end [s since the campaign began]."""

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
        """Wall time needs no telling."""

    def has_placed(self, duration_s: float) -> None:
        """Nor this."""
