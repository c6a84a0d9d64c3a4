"""The campaign's clock: when a run started, counted from the beginning of the campaign."""

from __future__ import annotations

import time
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


class SimulatedCampaignTime:
    """Runs one after another with a fixed turnaround: the same campaign whether or not it was interrupted."""

    def __init__(self) -> None:
        self._now_s = 0.0

    def now_s(self) -> float:
        """Return the simulated time since the campaign began [s]."""
        return self._now_s

    def has_run(self, started_s: float, duration_s: float) -> None:
        """Advance to when the next run can start."""
        self._now_s = started_s + duration_s + TURNAROUND_S


class WallCampaignTime:
    """The wall clock, since `began_unix_s`."""

    def __init__(self, began_unix_s: float) -> None:
        self._began_unix_s = began_unix_s

    def now_s(self) -> float:
        """Return the time since the campaign began [s]."""
        return time.time() - self._began_unix_s

    def has_run(self, started_s: float, duration_s: float) -> None:
        """Wall time needs no telling."""
