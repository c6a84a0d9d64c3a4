"""Run many independent tasks on processes of this machine, or on the workers of a cluster."""

from agvbench.executors.executor import Executor, ExecutorOptions, in_flight
from agvbench.executors.registry import check_address, open_executor
from agvbench.executors.task import Done, Failed, Outcome, Task, cause_of

__all__ = [
    "Done",
    "Executor",
    "ExecutorOptions",
    "Failed",
    "Outcome",
    "Task",
    "cause_of",
    "check_address",
    "in_flight",
    "open_executor",
]
