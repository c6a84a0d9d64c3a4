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


class Then(StrEnum):
    """What comes of a fault."""

    STOPS = "stopped; the session drives no more"
    ENDS = "stopped; the program ends"
    REJECTS = "driven to its end, rejected, driven again"
    GOES_ON = "driven to its end, and counts"
    REFUSES = "never moves: the session does not begin"


@dataclass(frozen=True)
class Outcome:
    """What came of a fault.

    ``reaction_s`` [s] is how long the vehicle was told to drive after the fault began (None: to the end of its run),
    ``said`` what the run that it befell failed with, ``later`` what the next failed with. ``intact`` is whether the run
    that was finished before stayed as it was, byte by byte, ``resumed`` whether a session without the fault then drove
    all that was missing.
    """

    reaction_s: float | None
    said: str
    later: str
    intact: bool
    resumed: bool


@dataclass(frozen=True)
class Fault:
    """A fault and what is promised.

    ``limit_s`` [s] is within which time the vehicle is stopped, ``message`` a part of the line that says why; ``play``
    injects it, in a directory for its campaign, on one of ``rigs``.
    """

    name: str
    stage: str
    injected: str
    then: Then
    play: Callable[[Path, str], Outcome]
    message: str = ""
    limit_s: float | None = None
    rigs: tuple[str, ...] = ("sim", "simavr")
    slow: bool = False


def all_faults() -> list[Fault]:
    """Return every fault of every file, in the order of their names."""
    names = sorted(info.name for info in pkgutil.iter_modules(fault_cases.__path__, f"{fault_cases.__name__}."))
    return [fault for name in names for fault in importlib.import_module(name).FAULTS]
