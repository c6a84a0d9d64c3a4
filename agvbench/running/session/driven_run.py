"""What a benchmark gets of the run that it drove."""

from __future__ import annotations

from agvbench.statistics import RunError, run_error
from agvbench.types import Run


class DrivenRun(Run):
    """A recorded run with its error, short enough to be read where an ``assert`` fails."""

    @classmethod
    def of(cls, run: Run) -> DrivenRun:
        """Return `run` with its error."""
        return cls(**vars(run))

    @property
    def error(self) -> RunError:
        """Where it ended against its target; see `RunError`.

        Raises
        ------
        InputError
            If the run has no target, as where a command was held.
        FitError
            If its start or end pose cannot be measured.
        """
        return run_error(self)

    def __repr__(self) -> str:
        return f"<run {self.run_id}>"
