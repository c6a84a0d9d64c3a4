"""The history of campaigns: trends of every metric, steps with their nights, and what changed there."""

from agvbench.workflows.history.reading import history
from agvbench.workflows.history.result import History

__all__ = ["History", "history"]
