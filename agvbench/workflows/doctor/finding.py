"""What a check is given, and what it finds."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import ClassVar

from agvbench.running.configuration.settings import BenchSettings

SIM = BenchSettings().agv
"""What is driven, and what sees it, where nothing is named."""


class FindingState(Enum):
    """How a check ended."""

    GOOD = "ok"
    DOUBTFUL = "look"
    BAD = "fails"
    IDLE = "not asked"


@dataclass(frozen=True)
class Finding:
    """One line: what was found, and what to do about it."""

    state: FindingState
    found: str
    remedy: str = ""


@dataclass(frozen=True)
class Lab:
    """What is to be driven, as a bench is asked for it, and the folder to record into."""

    settings: BenchSettings = field(default_factory=BenchSettings)
    folder: Path = Path()

    @property
    def names_camera_alone(self) -> bool:
        """Whether a camera is named, and no vehicle."""
        return self.settings.mocap != SIM and self.settings.agv == SIM

    @property
    def names_vehicle_alone(self) -> bool:
        """Whether a vehicle is named that this process opens, and no camera."""
        settings = self.settings
        return not settings.connect and settings.agv != SIM and settings.mocap == SIM


class Check(ABC):
    """Looks at one thing, moves nothing, and is done in a few seconds."""

    name: ClassVar[str]
    """What stands in the table."""

    @abstractmethod
    def examine(self, lab: Lab) -> Finding:
        """Return what is found; an `agvbench.errors.AgvbenchError` is reported as what fails."""
