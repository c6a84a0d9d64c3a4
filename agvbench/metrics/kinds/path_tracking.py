"""Errors along the path: driven poses against the planned path at the same progress."""

from __future__ import annotations

import math

import numpy as np

from agvbench.metrics.measured_run import MeasuredRun
from agvbench.metrics.metric import metric
from agvbench.types import Floats


@metric(unit="mm", title="cross-track error, RMS", margin=5.0)
def cross_track_rms(run: MeasuredRun) -> float:
    """Root mean square of the lateral offsets from the planned path, evenly spread over the way driven."""
    return _rms(_cross_track_mm(run))


@metric(unit="mm", title="cross-track error, 95 %", margin=5.0)
def cross_track_p95(run: MeasuredRun) -> float:
    """95th percentile of the absolute lateral offsets from the planned path."""
    offsets = _cross_track_mm(run)
    return float(np.percentile(np.abs(offsets), 95.0)) if len(offsets) else math.nan


@metric(unit="mm", title="cross-track error, maximum", margin=10.0)
def cross_track_max(run: MeasuredRun) -> float:
    """Largest absolute lateral offset from the planned path."""
    return float(np.max(np.abs(_cross_track_mm(run)), initial=-math.inf)) if run.tracking is not None else math.nan


@metric(unit="deg", title="heading along the path, RMS", digits=2, margin=1.0)
def path_heading_rms(run: MeasuredRun) -> float:
    """Root mean square of the heading minus that of the planned path at the same progress."""
    return _rms(np.degrees(run.tracking.heading_rad)) if run.tracking is not None else math.nan


def _cross_track_mm(run: MeasuredRun) -> Floats:
    return np.empty(0) if run.tracking is None else 1e3 * run.tracking.cross_track_m


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else math.nan
