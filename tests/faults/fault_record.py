"""A fault as a record: what is injected where, what has to come of it, within which time, and in which words.

A file in ``fault_cases/`` holds the faults of one stage as ``FAULTS``; nothing else has to know of it.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import fault_cases

_LATCHED = "the bench drives no more after the first failure: "


class Then(StrEnum):
    """What comes of a fault."""

    STOPS = "stopped; the session ends"
    ENDS = "stopped; the program ends"
    REJECTS = "not stopped; the run is rejected and repeated"
    RETRIES = "stopped; the run is rejected and repeated"
    FAILS = "stopped; the run fails, the session continues"
    GOES_ON = "not stopped; the run counts"
    REFUSES = "does not move; the session does not begin"


@dataclass(frozen=True)
class Outcome:
    """What came of a fault.

    ``reaction_s`` [s] is how long the vehicle was told to drive after the fault began (None: to the end of its run),
    ``said`` what the run that it befell, or an attempt at it, failed with, ``later`` what the next failed with.
    ``intact`` is whether the run that was finished before stayed as it was, byte by byte, ``resumed`` whether a session
    without the fault then drove all that was missing; ``attempts`` is what was recorded of the run that it befell,
    attempt by attempt: "ok", "rejected" or "aborted". None is for what was not tried.
    """

    reaction_s: float | None
    said: str
    later: str | None = None
    intact: bool | None = None
    resumed: bool | None = None
    attempts: tuple[str, ...] | None = None

    def breaks(self, fault: Fault, slack: float = 1.0) -> list[str]:
        """Return which promises of `fault` are broken, in words; times may be `slack` times as long."""
        late = fault.limit_s is not None and (self.reaction_s is None or self.reaction_s > slack * fault.limit_s)
        latched = self.later is None or (fault.then is Then.STOPS) == self.later.startswith(_LATCHED)
        promises = {
            f"stopped within {fault.limit_s} s, not {self.reaction_s} s": not late,
            f"says {fault.message!r}, not {self.said!r}": fault.message in self.said
            if fault.message
            else not self.said,
            "says so in one line": "\n" not in self.said,
            f"later runs fail with the same cause or not at all, not {self.later!r}": latched,
            "finished runs stay as they are": self.intact is not False,
            "can be resumed": self.resumed is not False,
            f"counts or is rejected as it should, not {self.attempts}": self._counts(fault.then),
        }
        return [promise for promise, kept in promises.items() if not kept]

    def _counts(self, then: Then) -> bool:
        if self.attempts is None or then not in {Then.GOES_ON, Then.REJECTS, Then.RETRIES}:
            return True
        if then is Then.GOES_ON:
            return self.attempts == ("ok",)
        *before, last = self.attempts
        return len(before) > 0 and set(before) == {"rejected"} and last in {"ok", "rejected"}


@dataclass(frozen=True)
class Fault:
    """A fault and what is promised.

    ``limit_s`` [s] is within which time the vehicle is stopped, ``message`` a part of the line that says why; ``play``
    injects it, in a directory for its campaign, on one of ``rigs``. What takes real time and is much like another fault
    is not ``tested`` with every change, only measured. ``instead`` stands in place of a time where none
    counts.
    """

    name: str
    stage: str
    injected: str
    then: Then
    play: Callable[[Path, str], Outcome]
    message: str = ""
    limit_s: float | None = None
    rigs: tuple[str, ...] = ("sim", "simavr")
    tested: bool = True
    instead: str = "not stopped"


def all_faults() -> list[Fault]:
    """Return every fault of every file, in the order of their names."""
    names = sorted(info.name for info in pkgutil.iter_modules(fault_cases.__path__, f"{fault_cases.__name__}."))
    return [fault for name in names for fault in importlib.import_module(name).FAULTS]
