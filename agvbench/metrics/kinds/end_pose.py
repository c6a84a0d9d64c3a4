"""Errors of the end pose against the target, as `agvbench.pose_errors` has them."""

from __future__ import annotations

import math

from agvbench.metrics.measured_run import MeasuredRun
from agvbench.metrics.metric import metric


@metric(unit="mm", title="end position error", margin=5.0)
def position_error(run: MeasuredRun) -> float:
    """Distance of the end position from the target position, both in the start frame."""
    return run.error.position_mm if run.target.is_finite else math.nan


@metric(unit="deg", title="heading error", digits=2, margin=1.0)
def heading_error(run: MeasuredRun) -> float:
    """Heading change minus that of the target, signed (Δδ of the thesis, section 8.2)."""
    return run.error.heading_deg if run.target.is_finite else math.nan


@metric(unit="mm", title="along", margin=5.0)
def along_error(run: MeasuredRun) -> float:
    """End position minus target position along x of the start frame, signed."""
    return run.error.along_mm if run.target.is_finite else math.nan


@metric(unit="mm", title="across", margin=5.0)
def across_error(run: MeasuredRun) -> float:
    """End position minus target position along y of the start frame, signed."""
    return run.error.across_mm if run.target.is_finite else math.nan


@metric(unit="mm", title="Δs", margin=5.0)
def delta_s(run: MeasuredRun) -> float:
    """Distance from start to end minus distance from start to target, signed (Δs of the thesis, section 8.2)."""
    return run.error.delta_s_mm if run.target.is_finite else math.nan
