"""Errors of runs, their spread, and comparisons."""

from agvbench.statistics.comparison import Comparison, compare_errors
from agvbench.statistics.differences import ComparisonVerdict, Difference
from agvbench.statistics.end_poses import end_pose_table
from agvbench.statistics.repeatability import bias_and_spread
from agvbench.statistics.run_errors import RunError, pose_errors, run_error, valid

__all__ = [
    "Comparison",
    "ComparisonVerdict",
    "Difference",
    "RunError",
    "bias_and_spread",
    "compare_errors",
    "end_pose_table",
    "pose_errors",
    "run_error",
    "valid",
]
