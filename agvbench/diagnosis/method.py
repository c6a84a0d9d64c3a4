"""The steps of every diagnosis, for any kind of recording: read, check, split, select, conclude."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Generic, TypeVar

from agvbench.diagnosis.context import DiagnosisContext
from agvbench.diagnosis.data.readings import Readings
from agvbench.diagnosis.data.splits import Split
from agvbench.diagnosis.result import Diagnosis
from agvbench.types import Run

OnProgress = Callable[[str], None]
"""Called with one line of text at each step of a diagnosis."""

Selected = TypeVar("Selected")


@dataclass
class Method(ABC, Generic[Selected]):
    """How one kind of recording is diagnosed; ``Selected`` is what its selection passes to its conclusion.

    ``no_test`` is the reason of a campaign that can spare nothing for the test.
    """

    no_test: ClassVar[str]
    context: DiagnosisContext
    on_progress: OnProgress

    def diagnose(self, runs: Sequence[Run]) -> Diagnosis:
        """Return the diagnosis of the vehicle that drove `runs`.

        Raises
        ------
        CampaignError, FitError
            If there are too few runs, or the tables are inconsistent.
        """
        readings = self.read(runs)
        if reason := self.insufficient_data(readings):
            return self.context.not_identifiable(readings, reason)
        split = self.split(readings)
        if not split.test.any():
            return self.context.not_identifiable(readings, self.no_test)
        return self.conclude(readings, split, self.select(readings, split))

    @abstractmethod
    def read(self, runs: Sequence[Run]) -> Readings:
        """Return the poses that are compared with predictions."""

    @abstractmethod
    def insufficient_data(self, readings: Readings) -> str:
        """Return why the campaign cannot be diagnosed, or an empty string; raise if it should be refused."""

    @abstractmethod
    def split(self, readings: Readings) -> Split:
        """Return the training, validation and test runs."""

    @abstractmethod
    def select(self, readings: Readings, split: Split) -> Selected:
        """Select effects, without a look at the poses of the test runs."""

    @abstractmethod
    def conclude(self, readings: Readings, split: Split, selected: Selected) -> Diagnosis:
        """Open the test runs, and return the diagnosis."""
