"""Errors of runs, their spread, and comparisons."""

from agvbench.statistics.comparison import Comparison, compare
from agvbench.statistics.differences import Difference
from agvbench.statistics.end_poses import end_pose_table
from agvbench.statistics.runs import pose_errors, valid
from agvbench.statistics.spread import bias_and_spread
from agvbench.statistics.verdict import Verdict

__all__ = [
    "Comparison",
    "Difference",
    "Verdict",
    "bias_and_spread",
    "compare",
    "end_pose_table",
    "pose_errors",
    "valid",
]
