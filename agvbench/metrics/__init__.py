"""Metrics: numbers with a unit that a run gives, those that ship and those of a lab.

A metric of a lab is a function in a file of the folder ``metrics``, with `metric` above it.
"""

from agvbench.metrics.measured_run import MeasuredRun
from agvbench.metrics.metric import Metric, metric
from agvbench.metrics.registry import all_metrics
from agvbench.metrics.table import metric_table

__all__ = ["MeasuredRun", "Metric", "all_metrics", "metric", "metric_table"]
