"""What a check is given, and what it finds."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import ClassVar


class State(Enum):
    """How a check ended."""

    GOOD = "ok"
    DOUBTFUL = "look"
    BAD = "fails"
    IDLE = "not asked"


@dataclass(frozen=True)
class Finding:
    """One line: what was found, and what to do about it."""

    state: State
    found: str
    remedy: str = ""


@dataclass(frozen=True)
class Lab:
    """What is to be used: adapters as on the bench, the camera's options, workspace, and the folder to record into.

    ``bus_config`` is the file of a secured bus, "" for none.
    """

    agv: str = "sim"
    mocap: str = "sim"
    camera: Mapping[str, str | float] = field(default_factory=dict)
    vehicle: str = "agv1"
    workspace: str = "circle:6.1"
    folder: Path = Path()
    bus_config: str = ""


class Check(ABC):
    """Looks at one thing, moves nothing, and is done in a few seconds."""

    name: ClassVar[str]
    """What stands in the table."""

    @abstractmethod
    def examine(self, lab: Lab) -> Finding:
        """Return what is found; an `agvbench.errors.AgvbenchError` is told as what fails."""
