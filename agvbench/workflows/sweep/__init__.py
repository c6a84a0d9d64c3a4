"""Sweeps: bench sessions over a grid of options, on this machine or on a cluster, and one table of their results."""

from agvbench.workflows.sweep.run import SweepResult, run_sweep, sweep

__all__ = ["SweepResult", "run_sweep", "sweep"]
